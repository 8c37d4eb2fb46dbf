// Scenes of a skin that creeps: the part of SceneSolver that follows it in time, for what it does depends on
// what has acted before. Keys are equilibria of the elastic skin under SkinHistory's loads.
#include <algorithm>
#include <cmath>
#include <utility>

#include "sensing/simulation/scene_solver.h"

namespace taclink {
namespace {

// Steps grow with the time since what acts has begun to change or to rest, as what still creeps does: with
// terms of any time constant the elastic forces are then nearly linear within a step.
constexpr double kFirstStepS = 0.05, kStepsPerPart = 16, kShareOfElapsed = 0.2;
constexpr double kLeastStepS = 1e-3;

// Of the parabola through three keys, at the middle one; of the first and the last key that of the chord.
template <typename Get>
auto RateAt(const std::vector<SkinKey>& keys, size_t at, Get get) {
  using Value = std::remove_cvref_t<decltype(get(keys[at]))>;
  const auto slope = [&](size_t from) -> Value {
    return (get(keys[from + 1]) - get(keys[from])) /
           static_cast<float>(keys[from + 1].time_s - keys[from].time_s);
  };
  if (keys.size() == 1) return Value(0 * get(keys[0]));
  if (at == 0) return slope(0);
  if (at + 1 == keys.size()) return slope(at - 1);
  const auto before = static_cast<float>(keys[at].time_s - keys[at - 1].time_s);
  const auto after = static_cast<float>(keys[at + 1].time_s - keys[at].time_s);
  return Value((after * slope(at - 1) + before * slope(at)) / (before + after));
}

void WriteKeyRates(std::vector<SkinKey>& keys) {
  for (size_t k = 0; k < keys.size(); ++k) {
    keys[k].rate = RateAt(keys, k, [](const SkinKey& key) -> const Eigen::VectorXf& { return key.place; });
    for (size_t i = 0; i < keys[k].contacts.size(); ++i) {
      KeyContact& contact = keys[k].contacts[i];
      if (contact.on)
        contact.rate = RateAt(
            keys, k, [i](const SkinKey& key) -> const KeyContact::Numbers& { return key.contacts[i].value; });
    }
  }
}

}  // namespace

Result<SolvedScene> SceneSolver::SolveCreeping() {
  SolvedScene solved;
  SkinBalance balance = skin_.Rest();
  for (const ScenePart& part : loads_.parts()) {
    auto begun =
        BeginCreeping(solved.parts.empty() ? nullptr : &solved.parts.back(), part, std::move(balance));
    if (!begun) return begun.error();
    balance = std::move(*begun);
    PlayedPart played{part, {MakeCreepingKey(part, part.begin_s, balance)}};
    if (auto good = CreepThrough(played, balance); !good) return good.error();
    WriteKeyRates(played.keys);
    solved.keys += static_cast<int>(played.keys.size());
    solved.parts.push_back(std::move(played));
  }
  solved.factorizations = skin_.factorizations();
  return solved;
}

// The state at a part's beginning: that of the end before, after what acts has jumped.
Result<SkinBalance> SceneSolver::BeginCreeping(const PlayedPart* before, const ScenePart& part,
                                               SkinBalance balance) {
  const double time_s = part.begin_s;
  const SkinLoad now = loads_.At(part, time_s);
  SkinLoad from{.pressure_mpa = 0, .discs = std::vector<SkinDisc>(scene_.contacts.size())};
  if (before) {
    from = loads_.At(before->part, time_s);
    if (IsSame(from, now)) return balance;
    from = history_.ElasticLoad(from, time_s);
  }
  auto reached =
      Jump(from, before ? history_.ElasticLoad(now, time_s) : history_.RelaxedLoad(now), balance, time_s);
  if (!reached) return reached.error();
  const Eigen::VectorXd elastic_n = skin_.InternalForces(reached->state);
  if (before)
    history_.Advance(time_s, elastic_n);
  else
    history_.Begin(time_s, elastic_n);
  return reached;
}

Result<void> SceneSolver::CreepThrough(PlayedPart& part, SkinBalance& balance) {
  const double begin_s = part.part.begin_s, end_s = part.part.end_s;
  const double most_s = part.part.still ? end_s - begin_s : (end_s - begin_s) / kStepsPerPart;
  double step_s = std::min(most_s, kFirstStepS);
  for (double time_s = begin_s; time_s < end_s;) {
    if (progress_) progress_(time_s / scene_.duration_s);
    const bool is_last = time_s + 1.3 * step_s >= end_s;
    const double next_s = is_last ? end_s : time_s + step_s;
    SkinBalance next = balance;
    if (!CreepTo(part, next_s, next)) {
      step_s = (next_s - time_s) / 2;
      if (step_s < kLeastStepS) return Refusal(next_s, last_stop_);
      continue;
    }
    balance = std::move(next);
    history_.Advance(next_s, skin_.InternalForces(balance.state));
    part.keys.push_back(MakeCreepingKey(part.part, next_s, balance));
    time_s = next_s;
    step_s = std::min({1.5 * step_s, most_s, std::max(kFirstStepS, kShareOfElapsed * (time_s - begin_s))});
  }
  return {};
}

// From the part's last key, whose balance is given: as the last step went on, or from where that led. False:
// too far, or no equilibrium was found.
bool SceneSolver::CreepTo(const PlayedPart& part, double time_s, SkinBalance& balance) {
  const SkinKey& last = part.keys.back();
  last_stop_ = "a step too long";
  if (IsFar(part.part, last, time_s)) return false;
  const SkinLoad load = history_.ElasticLoad(loads_.At(part.part, time_s), time_s);
  for (const bool extrapolates : {true, false}) {
    if (extrapolates && part.keys.size() < 2) continue;
    SkinBalance guess = balance;
    if (extrapolates) {
      const SkinKey& before = *(part.keys.end() - 2);
      const auto share = static_cast<float>((time_s - last.time_s) / (last.time_s - before.time_s));
      guess.state = FromPlace(last.place + share * (last.place - before.place)).state;
      for (size_t i = 0; i < last.contacts.size(); ++i) {
        if (last.contacts[i].on && before.contacts[i].on)
          guess.depth_mm[i] += share * (last.contacts[i].value[6] - before.contacts[i].value[6]);
      }
    }
    for (size_t i = 0; i < load.discs.size(); ++i)
      if (!load.discs[i].on) guess.depth_mm[i] = kOffMm;
    PlaceNewDiscs(load, guess);
    const BalanceSummary summary = skin_.Balance(load, guess);
    last_stop_ = Name(summary.stop);
    if (!summary.ok()) continue;
    balance = std::move(guess);
    return true;
  }
  return false;
}

SkinKey SceneSolver::MakeCreepingKey(const ScenePart& part, double time_s, const SkinBalance& balance) {
  ScenePart without_rates = part;
  without_rates.still = true;
  return MakeKey(without_rates, {.now = loads_.At(part, time_s), .before = {}, .after = {}}, time_s, balance);
}

}  // namespace taclink
