#include "sensing/simulation/scene_solver.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

namespace taclink {
namespace {

constexpr double kTouchMm = 0.02;      // of a disc that begins to press
constexpr double kAwayMm = 15;         // outside, of a disc that jumps away
constexpr double kLeastSpanS = 4e-3;   // between keys
constexpr double kMostRoughness = 10;  // of what is left at that span, by the tolerance
constexpr double kRateShare = 1e-4;    // of a part, to either side, for rates
constexpr double kRecallMm = 3;        // from where a state is guessed
constexpr double kWeakShare = 0.1;     // of its greatest, below which a force is judged as if it were that
// How much may change from one key to the next on the way through a part.
constexpr double kForceStride = 0.4;  // of what is asked
constexpr double kDepthStrideMm = 4, kSpotStrideMm = 6, kSpecificForceStrideMps2 = 3;

// The finer the contact's points, the smoother a slide; many discs would take much memory.
double SpacingMm(const Scene& scene) {
  constexpr size_t kFew = 4;
  return scene.contacts.size() <= kFew ? 0.4 : 0.8;
}

bool Same(const SkinDisc& a, const SkinDisc& b) {
  constexpr double kSame = 1e-9;
  if (a.on != b.on) return false;
  if (!a.on) return true;
  return std::abs(a.angle_rad - b.angle_rad) < kSame && std::abs(a.z_mm - b.z_mm) < kSame &&
         std::abs(a.depth_mm - b.depth_mm) < kSame &&
         std::abs(a.force_n.value_or(0) - b.force_n.value_or(0)) < kSame;
}

// What grows from nothing goes by `share`, what vanishes by the rest of it.
SkinLoad Blend(const SkinLoad& from, const SkinLoad& to, const std::vector<double>& touching, double share) {
  SkinLoad load = to;
  load.pressure_mpa = from.pressure_mpa + share * (to.pressure_mpa - from.pressure_mpa);
  load.specific_force_mps2 =
      from.specific_force_mps2 + share * (to.specific_force_mps2 - from.specific_force_mps2);
  for (size_t i = 0; i < load.discs.size(); ++i) {
    SkinDisc& disc = load.discs[i];
    if (from.discs[i].on == to.discs[i].on) continue;
    const double pressed = to.discs[i].on ? share : 1 - share;
    const double outside = to.discs[i].on ? touching[i] : -kAwayMm;
    if (from.discs[i].on) disc = from.discs[i];
    disc.on = pressed > 0;
    if (disc.force_n)
      *disc.force_n *= pressed;
    else
      disc.depth_mm = outside + pressed * (disc.depth_mm - outside);
  }
  return load;
}

}  // namespace

bool SceneSolver::IsSame(const SkinLoad& a, const SkinLoad& b) {
  bool same = std::abs(a.pressure_mpa - b.pressure_mpa) < 1e-12 &&
              (a.specific_force_mps2 - b.specific_force_mps2).norm() < 1e-6;
  for (size_t i = 0; i < a.discs.size(); ++i) same = same && Same(a.discs[i], b.discs[i]);
  return same;
}

SceneSolver::SceneSolver(const LinkModel& model, const Scene& scene, std::vector<ContactPlan> plans,
                         const SceneTolerance& tolerance, SceneProgress progress)
    : model_(model),
      scene_(scene),
      tolerance_(tolerance),
      progress_(std::move(progress)),
      skin_(model, scene.contacts.size(), {.refinement = scene.refinement, .spacing_mm = SpacingMm(scene)}),
      loads_(model, scene, std::move(plans), skin_.mesh()),
      history_(model),
      rest_(skin_.Rest().state),
      greatest_n_(scene.contacts.size(), 0) {}

Result<SolvedScene> SceneSolver::Solve() {
  if (auto solved = SolveFreeSkins(); !solved) return solved.error();
  if (history_.any()) return SolveCreeping();
  SolvedScene solved;
  for (const ScenePart& part : loads_.parts()) {
    auto first = Begin(solved.parts.empty() ? nullptr : &solved.parts.back(), part);
    if (!first) return first.error();
    PlayedPart played{part, {}};
    played.keys.push_back(std::move(*first));
    if (auto good = SolvePart(played); !good) return good.error();
    solved.keys += static_cast<int>(played.keys.size());
    solved.parts.push_back(std::move(played));
  }
  solved.factorizations = skin_.factorizations();
  if (auto good = CheckLoop(solved); !good) return good.error();
  return solved;
}

Result<void> SceneSolver::SolveFreeSkins() {
  SkinBalance balance = skin_.Rest();
  SkinLoad last{.pressure_mpa = 0, .discs = std::vector<SkinDisc>(scene_.contacts.size())};
  std::vector<ShellState> states;
  for (const double pressure : loads_.FreePressures()) {
    SkinLoad load = last;
    load.pressure_mpa = pressure;
    auto reached = Jump(last, load, std::move(balance), 0);
    if (!reached) return reached.error();
    balance = std::move(*reached);
    states.push_back(balance.state);
    last = load;
  }
  loads_.SetFreeSkins(std::move(states));
  return {};
}

// The state at a part's beginning: that of the end before, or from it in as many steps as needed.
Result<SkinKey> SceneSolver::Begin(const PlayedPart* before, const ScenePart& part) {
  SkinLoad from{.pressure_mpa = 0, .discs = std::vector<SkinDisc>(scene_.contacts.size())};
  SkinBalance balance = skin_.Rest();
  if (before) {
    from = loads_.At(before->part, before->part.end_s);
    balance = BalanceOf(before->keys.back(), 0);
  }
  const SkinLoad to = loads_.At(part, part.begin_s);
  if (!IsSame(from, to)) {
    auto reached = Jump(from, to, std::move(balance), part.begin_s);
    if (!reached) return reached.error();
    balance = std::move(*reached);
  }
  SkinKey key;
  if (!SolveAt(part, part.begin_s, balance, key)) return Refusal(part.begin_s, last_stop_);
  return key;
}

// A disc's force may rise with its depth and then fall, so that more force has no equilibrium nearby although
// there is one at the tube. Then by depth as far as a disc goes; a balance finds the way back from there.
Result<SkinBalance> SceneSolver::Jump(const SkinLoad& from, const SkinLoad& to, SkinBalance balance,
                                      double time_s) {
  auto reached = JumpAlong(from, to, balance, time_s);
  SkinLoad pressed = to;
  std::vector<bool> limited(to.discs.size(), false);
  for (size_t i = 0; i < to.discs.size(); ++i) {
    limited[i] = to.discs[i].on && !from.discs[i].on && to.discs[i].force_n;
    if (limited[i]) pressed.discs[i].force_n.reset();
  }
  if (reached || std::find(limited.begin(), limited.end(), true) == limited.end()) return reached;
  auto deep = JumpAlong(from, pressed, std::move(balance), time_s);
  if (!deep) return reached;
  for (size_t i = 0; i < limited.size(); ++i) deep->limited[i] = deep->limited[i] || limited[i];
  return skin_.Balance(to, *deep).ok() ? std::move(deep) : std::move(reached);
}

Result<SkinBalance> SceneSolver::JumpAlong(const SkinLoad& from, const SkinLoad& to, SkinBalance balance,
                                           double time_s) {
  std::vector<double> touching;
  for (size_t i = 0; i < to.discs.size(); ++i)
    touching.push_back(loads_.TouchingDepth(i, {to.discs[i].angle_rad, to.discs[i].z_mm}, balance.state));
  constexpr double kFirst = 0.25, kLeast = 1e-3;
  double step = kFirst;
  for (double share = 0; share < 1;) {
    const double next = share + step > 1 - 1e-9 ? 1 : share + step;
    const SkinLoad load = Blend(from, to, touching, next);
    SkinBalance trial = balance;
    PlaceNewDiscs(load, trial);
    const BalanceSummary summary = skin_.Balance(load, trial);
    if (summary.ok()) {
      balance = std::move(trial);
      share = next;
      step *= 1.5;
    } else if (step /= 2; step < kLeast) {
      return Refusal(time_s, Name(summary.stop));
    }
  }
  for (size_t i = 0; i < to.discs.size(); ++i) {
    if (!to.discs[i].on) balance.depth_mm[i] = kOffMm;
  }
  return balance;
}

Result<void> SceneSolver::SolvePart(PlayedPart& part) {
  if (part.part.still) return {};
  if (auto reached = Reach(part.part, part.part.end_s, part.keys); !reached) return reached.error();
  Keys coarse;
  coarse.swap(part.keys);
  part.keys.push_back(coarse.front());
  for (size_t i = 0; i + 1 < coarse.size(); ++i) {
    if (progress_) progress_(coarse[i].time_s / scene_.duration_s);
    if (auto good = Refine(part.part, coarse[i], coarse[i + 1], part.keys); !good) return good.error();
  }
  return {};
}

// Adds the key at a time, after others on the way there if it can't be reached at once.
Result<void> SceneSolver::Reach(const ScenePart& part, double time_s, Keys& keys) {
  const double span = time_s - keys.back().time_s;
  if (!IsFar(part, keys.back(), time_s)) {
    SkinBalance balance = BalanceOf(keys.back(), span);
    SkinKey key;
    if (SolveAt(part, time_s, balance, key)) {
      keys.push_back(std::move(key));
      return {};
    }
    if (span < kLeastSpanS) return Refusal(time_s, last_stop_);
  }
  const double middle = time_s - span / 2;
  if (auto reached = Reach(part, middle, keys); !reached) return reached.error();
  return Reach(part, time_s, keys);
}

// Adds the keys after `from` up to `to`.
Result<void> SceneSolver::Refine(const ScenePart& part, const SkinKey& from, const SkinKey& to, Keys& keys) {
  const double middle = (from.time_s + to.time_s) / 2, span = to.time_s - from.time_s;
  SkinKey key;
  SkinBalance balance = BalanceBetween(from, to, middle);
  if (!SolveAt(part, middle, balance, key)) {
    balance = BalanceOf(from, span / 2);
    if (!SolveAt(part, middle, balance, key)) return Refusal(middle, last_stop_);
  }
  const double error = ErrorOf(from, to, key);
  if (error > 1 && span >= 2 * kLeastSpanS) {
    if (auto good = Refine(part, from, key, keys); !good) return good.error();
    return Refine(part, key, to, keys);
  }
  if (error > kMostRoughness) return Refusal(middle, "the skin snaps");
  keys.push_back(std::move(key));
  keys.push_back(to);
  return {};
}

Result<void> SceneSolver::CheckLoop(const SolvedScene& solved) const {
  const PlayedPart &first = solved.parts.front(), &last = solved.parts.back();
  if (!scene_.loop ||
      !IsSame(loads_.At(first.part, first.part.begin_s), loads_.At(last.part, last.part.end_s)))
    return {};
  if (MarkerError(first.keys.front().place, last.keys.back().place) < tolerance_.marker_mm) return {};
  return Refusal(scene_.duration_s, "the skin does not come back to where it began");
}

bool SceneSolver::SolveAt(const ScenePart& part, double time_s, SkinBalance& balance, SkinKey& key) {
  const double h = part.still ? 0 : kRateShare * (part.end_s - part.begin_s);
  Around around{loads_.At(part, time_s), loads_.At(part, time_s - h, time_s),
                loads_.At(part, time_s + h, time_s), h};
  if (Recall(around, time_s, balance, key)) return true;
  PlaceNewDiscs(around.now, balance);
  const BalanceSummary summary = skin_.Balance(around.now, balance);
  last_stop_ = Name(summary.stop);
  if (!summary.ok()) return false;
  key = MakeKey(part, around, time_s, balance);
  solved_.push_back({std::move(around), key});
  return true;
}

// What goes up comes down through the same states, backwards: there is no friction. Not if the skin has
// snapped since and is elsewhere.
bool SceneSolver::Recall(const Around& around, double time_s, const SkinBalance& guess, SkinKey& key) const {
  for (const auto& [solved, solved_key] : solved_) {
    if (!IsSame(solved.now, around.now)) continue;
    const bool forwards = IsSame(solved.before, around.before) && IsSame(solved.after, around.after);
    const bool backwards = IsSame(solved.before, around.after) && IsSame(solved.after, around.before);
    if (!forwards && !backwards) continue;
    if (MarkerError(PlaceOf(guess), solved_key.place) > kRecallMm) continue;
    key = solved_key;
    key.time_s = time_s;
    if (!forwards) {
      key.rate *= -1;
      for (KeyContact& contact : key.contacts) contact.rate *= -1;
    }
    return true;
  }
  return false;
}

void SceneSolver::PlaceNewDiscs(const SkinLoad& load, SkinBalance& balance) const {
  for (size_t i = 0; i < load.discs.size(); ++i) {
    const SkinDisc& disc = load.discs[i];
    if (!disc.on || !disc.force_n || std::isfinite(balance.depth_mm[i])) continue;
    balance.depth_mm[i] = kTouchMm + loads_.TouchingDepth(i, {disc.angle_rad, disc.z_mm}, balance.state);
    balance.limited[i] = false;
  }
}

bool SceneSolver::IsFar(const ScenePart& part, const SkinKey& from, double time_s) const {
  const SkinLoad a = loads_.At(part, from.time_s), b = loads_.At(part, time_s);
  const double radius = model_.PointAtDepth(0, model_.length_mm / 2, 0).x();
  const double pressure_stride = 2 * PressedSkinOptions{}.pressure_step * model_.material.youngs_modulus_mpa *
                                 model_.thickness_mm / radius;
  bool far = std::abs(a.pressure_mpa - b.pressure_mpa) > pressure_stride ||
             (a.specific_force_mps2 - b.specific_force_mps2).norm() > kSpecificForceStrideMps2;
  for (size_t i = 0; i < a.discs.size(); ++i) {
    const SkinDisc &x = a.discs[i], &y = b.discs[i];
    const auto& asked = scene_.contacts[i].force_n;
    if (asked) {
      const double change = y.force_n.value_or(0) - x.force_n.value_or(0);
      far = far || std::abs(change) > kForceStride * *asked;
    }
    if (!x.on || !y.on) continue;
    const Vec3 way =
        model_.PointAtDepth(x.angle_rad, x.z_mm, 0) - model_.PointAtDepth(y.angle_rad, y.z_mm, 0);
    far = far || way.norm() > kSpotStrideMm;
    if (!asked) far = far || std::abs(y.depth_mm - x.depth_mm) > kDepthStrideMm;
  }
  return far;
}

// Of what is played halfway, by the tolerances.
double SceneSolver::ErrorOf(const SkinKey& from, const SkinKey& to, const SkinKey& solved) {
  double error = MarkerError(PlaceAt(from, to, solved.time_s), solved.place) / tolerance_.marker_mm;
  for (size_t i = 0; i < solved.contacts.size(); ++i) {
    if (!solved.contacts[i].on) continue;
    const Eigen::Vector3f force = solved.contacts[i].value.head<3>();
    const double off = (ContactAt(from, to, i, solved.time_s).head<3>() - force).norm();
    const double scale = std::max(static_cast<double>(force.norm()), kWeakShare * greatest_n_[i]);
    if (scale > 0) error = std::max(error, off / (tolerance_.force_share * scale));
  }
  return error;
}

double SceneSolver::MarkerError(const Eigen::VectorXf& a, const Eigen::VectorXf& b) const {
  const float inward = static_cast<float>(model_.thickness_mm / 2 - model_.markers.center_depth_mm);
  double worst = 0;
  for (int marker = 0; marker < model_.markers.count(); ++marker) {
    const Eigen::Index at = Eigen::Index{6} * skin_.mesh().NodeOfMarker(model_, marker);
    const Eigen::Matrix<float, 6, 1> off = a.segment<6>(at) - b.segment<6>(at);
    worst = std::max(worst, static_cast<double>((off.head<3>() + inward * off.tail<3>()).norm()));
  }
  return worst;
}

// Names the contact that presses most then.
Error SceneSolver::Refusal(double time_s, const std::string& why) const {
  std::string where = "scene '" + scene_.name + "'";
  double most = 0;
  for (size_t i = 0; i < scene_.contacts.size(); ++i) {
    const double level = loads_.plans()[i].Level(time_s);
    const double pressed = scene_.contacts[i].depth_mm.value_or(0) + scene_.contacts[i].force_n.value_or(0);
    if (level * pressed <= most) continue;
    most = level * pressed;
    if (!scene_.contacts[i].where.empty()) where = scene_.contacts[i].where;
  }
  char time[32];
  std::snprintf(time, sizeof time, "%.3f", time_s);
  return {ErrorCode::kFailedPrecondition,
          where + ": no equilibrium of the skin at " + time + " s (" + why + "); use a smaller " +
              (most > 0 ? "depth or force" : "pressure") +
              (scene_.motion ? ", a slower or smaller swing, or a higher pressure" : ", or 'skin: linear'")};
}

}  // namespace taclink
