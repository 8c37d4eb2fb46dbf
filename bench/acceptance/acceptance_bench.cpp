#include "bench/acceptance/acceptance_bench.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <mutex>
#include <opencv2/core.hpp>
#include <optional>
#include <random>
#include <thread>
#include <utility>

#include "bench/played/played_link.h"
#include "bench/tools/thread_clock.h"
#include "sensing/acceptance/acceptance_plan.h"
#include "sensing/acceptance/reading_collector.h"
#include "sensing/core/similar_skin.h"
#include "sensing/core/units.h"
#include "sensing/simulation/scene.h"

namespace taclink {
namespace {

// Trials that identify every flaw: eight places slack and inflated, a hold and pressure steps. Weak loads on
// the slack skin, which is soft.
constexpr const char* kPlan = R"(taclink_acceptance: 1
name: bench
series:
  - {name: slack, force_n: 0.1, pressure_kpa: 0, places: 8}
  - {name: inflated, force_n: 0.5, pressure_kpa: 1, places: 8, repetitions: 2}
  - {name: hold, force_n: 0.4, pressure_kpa: 1, places: 1, hold_s: 60}
  - {name: half, pressure_kpa: 0.5, repetitions: 2}
  - {name: whole, pressure_kpa: 1, repetitions: 2}
  - {name: high, pressure_kpa: 1.4, repetitions: 2}
)";
constexpr double kRateHz = 10, kHoldRateHz = 2, kRampS = 0.3, kPatchMm = 11, kRestS = 1.2;
// Times within a trial, s: start of the load, start of the reading; duration of the reading and of the
// release.
constexpr double kBeginS = 0.2, kLoadedS = 0.8, kReadS = 0.6, kReleasedS = 0.6;
constexpr double kModulusOff = 0.1, kGainOff = 0.05, kTurnRad = 5 * kPi / 180, kCameraMm = 0.3,
                 kCreepOff = 0.08;
constexpr double kManometerKpa = 0.001;  // standard deviation

double SignOf(bool is_negative) {
  return is_negative ? -1 : 1;
}

/// A simulated link with a flaw in its images, pressure sensor or references.
class AcceptedBenchLink {
 public:
  AcceptedBenchLink(const LinkModel& model, uint64_t seed, AcceptanceOutcome& outcome)
      : model_(model), outcome_(outcome), random_(seed) {
    CameraEffects effects;
    effects.marker_jitter_px = 0.15;
    std::normal_distribution<double> normal;
    for (MountError& mount : effects.mount) {
      mount.shift_mm = 0.3 * Vec3(normal(random_), normal(random_), normal(random_));
      mount.turn_rad = 0.005 * Vec3(normal(random_), normal(random_), normal(random_));
    }
    const CameraEffects calibrated = effects;
    if (outcome.flaw == LinkFlaw::kCamera) {
      const double angle = std::uniform_real_distribution<double>(0, 2 * kPi)(random_);
      effects.mount[random_() % kCameraCount].shift_mm +=
          kCameraMm * Vec3(std::cos(angle), std::sin(angle), 0);
    }
    LinkModel known = model;
    if (outcome.flaw == LinkFlaw::kModulus)
      known.material.youngs_modulus_mpa *= 1 + kModulusOff * SignOf(outcome.is_negative);
    // J(60 s) = 1 + kCreepOff, by one term with a time constant that is short relative to the hold.
    if (outcome.flaw == LinkFlaw::kCreep)
      model_.relaxation.terms = {{.share = 1 - 1 / (1 + kCreepOff), .time_s = 12}};
    PipelineOptions options;
    options.rig = MountedRig(model.nominal_rig, calibrated);
    const bool is_gain = outcome.flaw == LinkFlaw::kPressure;
    link_.emplace(PlayedLink::Built{.model = model_,
                                    .effects = effects,
                                    .known = known,
                                    .options = options,
                                    .pressure_gain = is_gain ? 1 + kGainOff * SignOf(outcome.is_negative) : 1,
                                    .seed = seed});
  }

  Result<void> Accept() {
    const auto plan = ParseAcceptancePlan("bench plan", kPlan);
    if (!plan) return plan.error();
    AcceptancePlan own = *plan;
    own.seed = static_cast<int>(random_() % 1000);
    auto trials = MakeTrials(own, model_);
    if (!trials) return trials.error();
    AcceptanceRecord& record = outcome_.record;
    record.link = "bench";
    record.plan = plan->name;
    record.model = model_.name;
    record.limits = plan->limits;
    record.trials = std::move(*trials);
    if (auto rested = Play(Still(kRestS), nullptr, nullptr); !rested) return rested;
    for (AcceptanceTrial& trial : record.trials)
      if (auto measured = Measure(trial); !measured) return measured;
    return {};
  }

 private:
  Scene Still(double duration_s) const {
    Scene scene;
    scene.name = "acceptance";
    scene.frame_rate_hz = kRateHz;
    scene.duration_s = duration_s;
    scene.loop = false;
    scene.pressure = {{0, kpa_}};
    return scene;
  }

  Result<void> Measure(AcceptanceTrial& trial) {
    if (trial.pressure_mpa) {
      const double wanted_kpa = *trial.pressure_mpa / kMpaPerKpa;
      if (wanted_kpa != kpa_) {
        Scene ramp = Still(kRestS);
        ramp.pressure = {{0, kpa_}, {1, wanted_kpa}};
        kpa_ = wanted_kpa;
        if (auto played = Play(ramp, nullptr, nullptr); !played) return played;
      }
    }
    trial.state = TrialState::kMeasured;
    trial.reference.pressure_mpa =
        kMpaPerKpa * (kpa_ + kManometerKpa * std::normal_distribution<double>()(random_));
    if (trial.kind == TrialKind::kPressure) {
      ReadingCollector reading(std::nullopt);
      auto played = Play(Still(kReadS), &reading, nullptr);
      trial.loaded = reading.Reading();
      return played;
    }
    return Load(trial);
  }

  Result<void> Load(AcceptanceTrial& trial) {
    const double angle = model_.PathAngle(trial.path - 1);
    const double z_mm = model_.markers.rings_z_mm[static_cast<size_t>(trial.ring - 1)];
    const double loaded_s = std::max(kLoadedS + kReadS, trial.hold_s + kLoadedS);
    Scene scene = Still(loaded_s + 2 * kRampS + kReleasedS);
    if (trial.hold_s > 0) scene.frame_rate_hz = kHoldRateHz;
    SceneContact& contact = scene.contacts.emplace_back();
    contact.at = {.path = 0, .ring = 0, .angle_rad = angle, .z_mm = z_mm};
    contact.patch_diameter_mm = kPatchMm;
    contact.force_n = *trial.force_n;
    contact.begin_s = kBeginS;
    contact.end_s = loaded_s + kRampS;
    contact.ramp_s = kRampS;
    contact.where = "acceptance";
    const Vec3 place_mm = model_.PointAtDepth(angle, z_mm, 0);
    // The references are turned the opposite way about the link's axis.
    const double turn = outcome_.flaw == LinkFlaw::kMounting ? -kTurnRad * SignOf(outcome_.is_negative) : 0;
    trial.reference.place_mm = Eigen::AngleAxisd(turn, Vec3::UnitZ()) * place_mm;
    trial.reference.direction =
        Eigen::AngleAxisd(turn, Vec3::UnitZ()) * Vec3(-model_.OutwardNormal(angle, z_mm));
    trial.reference.force_n = *trial.force_n;
    ReadingCollector loaded(place_mm, kSameContactMm * LengthUnit(model_), trial.kind == TrialKind::kHold);
    ReadingCollector released(place_mm, kSameContactMm * LengthUnit(model_));
    loaded_until_s_ = loaded_s;
    auto played = Play(scene, &loaded, &released);
    trial.loaded = loaded.Reading();
    trial.released = released.Reading();
    return played;
  }

  Result<void> Play(const Scene& scene, ReadingCollector* loaded, ReadingCollector* released) {
    const bool is_load = !scene.contacts.empty();
    return link_->Play(scene, [&](const SkinTruth& truth, const LinkState& state) {
      const double time_s = truth.time_s;
      if (loaded && (!is_load || (time_s >= kLoadedS && time_s <= loaded_until_s_))) loaded->Add(state);
      if (released && time_s > loaded_until_s_ + 2 * kRampS) released->Add(state);
    });
  }

  LinkModel model_;  // the true skin
  AcceptanceOutcome& outcome_;
  std::mt19937_64 random_;
  std::optional<PlayedLink> link_;
  double kpa_ = 0, loaded_until_s_ = 0;
};

bool Names(const AcceptanceReport& report, FindingId id) {
  return std::ranges::any_of(report.findings, [id](const auto& finding) { return finding.id == id; });
}

// Findings that a flaw explains, the expected one first. A wrong modulus also causes an effect of pressure
// and a reason reported by the link.
std::vector<FindingId> FindingsOf(LinkFlaw flaw) {
  switch (flaw) {
    case LinkFlaw::kModulus:
      return {FindingId::kForceScale, FindingId::kPressureEffect, FindingId::kWithheld};
    case LinkFlaw::kPressure:
      return {FindingId::kPressureSensor, FindingId::kPressureEffect, FindingId::kWithheld};
    case LinkFlaw::kMounting:
      return {FindingId::kMounting};
    case LinkFlaw::kCamera:
      return {FindingId::kCamera, FindingId::kPhantom, FindingId::kMounting};
    case LinkFlaw::kCreep:
      return {FindingId::kCreep};
    case LinkFlaw::kNone:
      break;
  }
  return {};
}

void AddClaims(AcceptanceOutcome& outcome) {
  const double sign = SignOf(outcome.is_negative);
  const auto claim = [&outcome](const char* id, double truth) {
    const AcceptanceQuantity* quantity = outcome.report.Quantity(id);
    if (quantity && quantity->low && quantity->high)
      outcome.claims.push_back({id, truth, quantity->value, *quantity->low, *quantity->high});
  };
  claim("pressure_gain", outcome.flaw == LinkFlaw::kPressure ? 100 * kGainOff * sign : 0);
  claim("turn_z", outcome.flaw == LinkFlaw::kMounting ? sign * DegFromRad(kTurnRad) : 0);
  claim("creep", outcome.flaw == LinkFlaw::kCreep ? 100 * kCreepOff : 0);
}

AcceptanceOutcome AcceptOne(const LinkModel& model, uint64_t seed) {
  AcceptanceOutcome outcome;
  outcome.seed = seed;
  outcome.flaw = static_cast<LinkFlaw>(seed % kLinkFlaws);
  outcome.is_negative = seed / kLinkFlaws % 2 == 1;
  const int64_t begin_ns = ThreadCpuClock().MonotonicNs();
  AcceptedBenchLink link(model, seed, outcome);
  if (const auto accepted = link.Accept(); !accepted) {
    outcome.failure = accepted.error().message;
    return outcome;
  }
  outcome.cpu_s = 1e-9 * static_cast<double>(ThreadCpuClock().MonotonicNs() - begin_ns);
  outcome.report = AnalyzeAcceptance(outcome.record);
  AddClaims(outcome);
  const std::vector<FindingId> right = FindingsOf(outcome.flaw);
  outcome.is_found = !right.empty() && Names(outcome.report, right.front());
  for (const AcceptanceFinding& finding : outcome.report.findings)
    if (std::ranges::find(right, finding.id) == right.end()) outcome.false_ones.push_back(finding.id);
  return outcome;
}

std::string Share(int part, int of) {
  char text[48];
  std::snprintf(text, sizeof text, "%d of %d", part, of);
  return text;
}

}  // namespace

std::vector<AcceptanceOutcome> RunAcceptanceBench(const LinkModel& model,
                                                  const AcceptanceBenchOptions& options) {
  cv::setNumThreads(1);
  std::vector<AcceptanceOutcome> outcomes(static_cast<size_t>(options.links));
  std::atomic<size_t> next = 0;
  std::mutex mutex;
  const auto work = [&] {
    for (size_t i = next++; i < outcomes.size(); i = next++) {
      outcomes[i] = AcceptOne(model, static_cast<uint64_t>(options.first) + i);
      const std::lock_guard lock(mutex);
      if (options.done) options.done(outcomes[i]);
    }
  };
  std::vector<std::thread> workers;
  for (int i = 1; i < options.jobs; ++i) workers.emplace_back(work);
  work();
  for (std::thread& worker : workers) worker.join();
  return outcomes;
}

ReportTable AcceptanceTable(const std::vector<AcceptanceOutcome>& outcomes) {
  ReportTable table{.title = "Acceptance of simulated links",
                    .header = {"flaw", "links", "found", "false findings", "intervals that hold the truth"},
                    .rows = {}};
  int held_all = 0, claims_all = 0;
  for (int flaw = 0; flaw < kLinkFlaws; ++flaw) {
    int links = 0, found = 0, wrong = 0, held = 0, claims = 0;
    for (const AcceptanceOutcome& outcome : outcomes) {
      if (static_cast<int>(outcome.flaw) != flaw || !outcome.failure.empty()) continue;
      ++links;
      found += outcome.is_found ? 1 : 0;
      wrong += outcome.false_ones.empty() ? 0 : 1;
      for (const AcceptanceClaim& claim : outcome.claims) {
        ++claims;
        held += claim.holds() ? 1 : 0;
      }
    }
    held_all += held;
    claims_all += claims;
    table.rows.push_back({kLinkFlawNames[flaw], std::to_string(links), flaw == 0 ? "-" : Share(found, links),
                          Share(wrong, links), Share(held, claims)});
  }
  table.rows.push_back({"all", std::to_string(outcomes.size()), "", "", Share(held_all, claims_all)});
  return table;
}

}  // namespace taclink
