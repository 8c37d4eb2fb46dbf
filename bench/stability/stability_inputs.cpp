#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "bench/force/accuracy_bench.h"
#include "bench/stability/stability_cases.h"
#include "bench/tools/child_process.h"
#include "sensing/pipeline/link_pipeline.h"
#include "sensing/pipeline/marker_solve.h"
#include "sensing/shell/pressed_skin.h"
#include "sensing/shell/skin_push.h"

namespace taclink {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kPressureMpa = 1e-3, kHugeMps2 = 1e6;
constexpr int kStabilityTruthRefinement = 2;

StabilityRow Row(const std::string& name, Ending ending, const std::string& reason) {
  return {name, ending, reason, kNan, kNan, kNan, kNan, kNan};
}

// In a process of its own: a case that crashes or never ends must not take the others along.
StabilityRow Guarded(const std::string& name, const std::function<StabilityRow()>& run) {
  constexpr int kMostSeconds = 60;
  const auto answer = InChildProcess(
      [&] {
        const StabilityRow row = run();
        return std::to_string(static_cast<int>(row.ending)) + row.reason;
      },
      kMostSeconds);
  if (!answer || answer->empty())
    return Row(name, Ending::kWrong,
               "crashes, or does not end within " + std::to_string(kMostSeconds) + " s");
  return Row(name, static_cast<Ending>(answer->front() - '0'), answer->substr(1));
}

enum class Expected {
  kSameForce,  ///< as without the defect, or a refusal
  kNoForce,    ///< nothing was seen
};

struct InputCase {
  const char* name;
  Expected expected;
  void (*spoil)(SkinShape& shape, size_t pressed, MeasuredLoads& now);
};

void Lose(SkinShape& shape, size_t marker) {
  shape.sources[marker] = MarkerSource::kInferred;
  shape.measured[marker] = {};
}

std::vector<InputCase> SpoiltMarkers() {
  return {{"NaN in a far marker", Expected::kSameForce,
           [](SkinShape& s, size_t, MeasuredLoads&) { s.measured[0].displacement_mm.y() = kNan; }},
          {"NaN in the pressed marker", Expected::kSameForce,
           [](SkinShape& s, size_t m, MeasuredLoads&) { s.measured[m].displacement_mm.x() = kNan; }},
          {"infinity in the pressed marker", Expected::kSameForce,
           [](SkinShape& s, size_t m, MeasuredLoads&) { s.measured[m].displacement_mm.x() = kInf; }},
          {"NaN in an information matrix", Expected::kSameForce,
           [](SkinShape& s, size_t m, MeasuredLoads&) { s.measured[m].information_per_mm2(1, 1) = kNan; }},
          {"infinite information", Expected::kSameForce,
           [](SkinShape& s, size_t m, MeasuredLoads&) { s.measured[m].information_per_mm2(1, 1) = kInf; }},
          {"NaN in all but the measured displacements", Expected::kSameForce,
           [](SkinShape& s, size_t, MeasuredLoads&) {
             std::fill(s.displacements_mm.begin(), s.displacements_mm.end(), Vec3::Constant(kNan));
             std::fill(s.positions_mm.begin(), s.positions_mm.end(), Vec3::Constant(kNan));
           }}};
}

std::vector<InputCase> LostMarkers() {
  return {
      {"every other marker gone", Expected::kSameForce,
       [](SkinShape& s, size_t, MeasuredLoads&) {
         for (size_t m = 0; m < s.sources.size(); m += 2) Lose(s, m);
       }},
      {"the half of the markers away from the contact gone", Expected::kSameForce,
       [](SkinShape& s, size_t m, MeasuredLoads&) {
         const Vec3 at = s.positions_mm[m];
         for (size_t k = 0; k < s.sources.size(); ++k) {
           if (s.positions_mm[k].head<2>().dot(at.head<2>()) < 0) Lose(s, k);
         }
       }},
      {"a marker 1e6 mm away without information", Expected::kSameForce,
       [](SkinShape& s, size_t m, MeasuredLoads&) { s.measured[m] = {Vec3::Constant(1e6), Mat3::Zero()}; }},
      {"all markers gone", Expected::kNoForce,
       [](SkinShape& s, size_t, MeasuredLoads&) {
         for (size_t m = 0; m < s.sources.size(); ++m) Lose(s, m);
       }},
      {"all markers NaN", Expected::kNoForce,
       [](SkinShape& s, size_t, MeasuredLoads&) {
         for (auto& measured : s.measured) measured.displacement_mm.setConstant(kNan);
       }},
      {"pressure NaN", Expected::kNoForce,
       [](SkinShape&, size_t, MeasuredLoads& now) { now.pressure_mpa = kNan; }},
      {"pressure infinite", Expected::kNoForce,
       [](SkinShape&, size_t, MeasuredLoads& now) { now.pressure_mpa = kInf; }},
      {"specific force NaN", Expected::kNoForce,
       [](SkinShape&, size_t, MeasuredLoads& now) { now.specific_force_mps2.y() = kNan; }},
      {"specific force infinite", Expected::kNoForce,
       [](SkinShape&, size_t, MeasuredLoads& now) { now.specific_force_mps2.y() = kInf; }},
      {"specific force of 1e6 m/s^2", Expected::kNoForce,
       [](SkinShape&, size_t, MeasuredLoads& now) { now.specific_force_mps2.y() = kHugeMps2; }},
  };
}

bool IsFinite(const NodalForces& forces) {
  const auto finite = [](double v) { return std::isfinite(v); };
  return std::all_of(forces.forces_n.begin(), forces.forces_n.end(),
                     [](const Vec3& f) { return f.allFinite(); }) &&
         std::all_of(forces.sigmas_n.begin(), forces.sigmas_n.end(), finite) && finite(forces.residual) &&
         finite(forces.region_residual);
}

Vec3 Total(const NodalForces& forces) {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& f : forces.forces_n) sum += f;
  return sum;
}

StabilityRow Verdict(const std::string& name, Expected expected, const LinkState& state,
                     const Vec3& clean_n) {
  const NodalForces& forces = state.forces;
  const std::string reasons = ReasonsOf(state);
  const bool answers = forces.converged && state.status != LinkStatus::kLost;
  if (!answers) return Row(name, reasons.empty() ? Ending::kWrong : Ending::kRefused, "it says: " + reasons);
  if (!IsFinite(forces)) return Row(name, Ending::kWrong, "forces, deviations or residual not finite");
  char text[128];
  bool same = false;
  if (expected == Expected::kNoForce) {
    const double force = Total(forces).norm();
    std::snprintf(text, sizeof text, "force %.3f N, must be 0", force);
    same = force < 1e-9;
  } else {
    const double difference = (Total(forces) - clean_n).norm();
    std::snprintf(text, sizeof text, "force differs by %.3f N from %.3f N without the defect", difference,
                  clean_n.norm());
    same = difference <= std::max(0.03, 0.1 * clean_n.norm());
  }
  if (same) return Row(name, Ending::kRight, text);
  if (reasons.empty()) return Row(name, Ending::kWrong, text);
  return Row(name, Ending::kRefused, "it says: " + reasons + " (" + text + ")");
}

// All defects, one by one, each to an estimator that knows nothing of what was before.
void RunEstimator(const LinkModel& model, const ForceMethod& method, const TrueStage& truth, size_t pressed,
                  const std::function<void(const StabilityRow&)>& add) {
  ForceOptions options;
  options.model = method.model;
  options.refinement = method.refinement;
  const auto estimator = MakeStateEstimator(model, options);
  const MeasuredLoads measured{kPressureMpa, PressureSigma(PressureOrigin::kSimulated)};
  const auto estimate = [&](const MeasuredLoads& now, const SkinShape& shape) {
    return SolveMarkers(model, *estimator, {.now = now, .baseline = {}}, shape);
  };
  SkinShape clean;
  MakeShape(model, truth, kNoiseMm, 1, clean);
  const LinkState without = estimate(measured, clean);
  const NodalForces& forces = without.forces;
  const std::string who =
      "estimator " + method.name() +
      (method.model && forces.model != *method.model ? std::string(" (answers as ") + Name(forces.model) + ")"
                                                     : std::string()) +
      ": ";
  const Vec3 clean_n = Total(forces);
  add(Verdict(who + "no defect", Expected::kSameForce, without, truth.contacts.front().force_n));
  std::vector<InputCase> inputs = SpoiltMarkers();
  for (const InputCase& lost : LostMarkers()) inputs.push_back(lost);
  for (const InputCase& input : inputs) {
    add(Guarded(who + input.name, [&] {
      SkinShape shape = clean;
      MeasuredLoads now = measured;
      input.spoil(shape, pressed, now);
      estimator->Restart();
      return Verdict(who + input.name, input.expected, estimate(now, shape), clean_n);
    }));
  }
}

StabilityRow Refusal(const std::string& name, bool refused, const std::string& reason) {
  return Row(name, refused ? Ending::kRefused : Ending::kWrong, reason);
}

void RunPushes(const LinkModel& model, const std::function<void(const StabilityRow&)>& add) {
  const std::vector<std::pair<std::string, SkinPush>> pushes = {
      {"depth NaN", {.depth_mm = kNan, .refinement = 1}},
      {"depth infinite", {.depth_mm = kInf, .refinement = 1}},
      {"deeper than the tube", {.depth_mm = 22, .refinement = 1}},
      {"pressure NaN", {.depth_mm = 1, .pressure_mpa = kNan, .refinement = 1}},
      {"pressure of 1 MPa", {.depth_mm = 1, .pressure_mpa = 1, .refinement = 1}},
      {"specific force NaN", {.depth_mm = 1, .specific_force_mps2 = Vec3(0, kNan, 0), .refinement = 1}},
      {"specific force of 1e6 m/s^2",
       {.depth_mm = 1, .specific_force_mps2 = Vec3(0, kHugeMps2, 0), .refinement = 1}},
      {"patch NaN", {.depth_mm = 1, .patch_diameter_mm = kNan, .refinement = 1}}};
  for (const auto& [name, push] : pushes) {
    const auto result = PushSkin(model, push);
    add(Refusal("push: " + name, !result.ok(), result.ok() ? "it answered" : result.error().message));
  }
}

bool IsFinite(const PressedSkin& skin) {
  return skin.known_loads().Stacked().allFinite() &&
         std::all_of(skin.state().mids_mm.begin(), skin.state().mids_mm.end(),
                     [](const Vec3& p) { return p.allFinite(); });
}

void RunPressedSkin(const LinkModel& model, const std::function<void(const StabilityRow&)>& add) {
  for (const double pressure : {kNan, kInf, 1e3}) {
    const std::string name = "pressed skin: inflated by " + std::to_string(pressure) + " MPa";
    add(Guarded(name, [&] {
      PressedSkin skin(model, {.refinement = 1});
      const PressSummary summary = skin.Inflate(pressure);
      return Refusal(name, !summary.ok() && IsFinite(skin),
                     summary.Text() + (IsFinite(skin) ? "" : "; leaves what is not finite behind"));
    }));
  }
  for (const double mps2 : {kNan, kInf, kHugeMps2}) {
    const std::string name = "pressed skin: specific force of " + std::to_string(mps2) + " m/s^2";
    add(Guarded(name, [&] {
      PressedSkin skin(model, {.refinement = 1});
      const PressSummary summary = skin.Load({0, Vec3(0, mps2, 0)});
      return Refusal(name, !summary.ok() && IsFinite(skin), summary.Text());
    }));
  }
  for (const double way : {kNan, kInf}) {
    const std::string name = "pressed skin: body moved by " + std::to_string(way) + " mm";
    add(Guarded(name, [&] {
      PressedSkin skin(model, {.refinement = 1});
      skin.AddBody(RigidSphere{Vec3(60, 0, model.length_mm / 2), 10}, false);
      const Vec3 by(way, 0, 0);
      const PressSummary summary = skin.Move({&by, 1});
      return Refusal(name, !summary.ok() && IsFinite(skin), summary.Text());
    }));
  }
}

}  // namespace

std::vector<StabilityRow> RunInputCases(const LinkModel& base,
                                        const std::function<void(const StabilityRow&)>& done) {
  std::vector<StabilityRow> rows;
  const auto add = [&](const StabilityRow& row) {
    rows.push_back(row);
    if (done) done(row);
  };
  const PathTruth truth =
      SolvePath(base, MakePressPath(base, PressKind::kSphereMarker, kPressureMpa), kStabilityTruthRefinement);
  if (truth.stages.size() < 2) {
    add(Row("estimators", Ending::kWrong, "no truth to show them: " + truth.failure));
    return rows;
  }
  const TrueStage& stage = truth.stages[1];  // 5 mm deep
  const Vec3 at = stage.contacts.front().center_mm;
  size_t pressed = 0;
  for (size_t m = 0; m < stage.displacements_mm.size(); ++m) {
    const auto distance = [&](size_t i) { return (base.RestMarker(static_cast<int>(i)) - at).norm(); };
    if (distance(m) < distance(pressed)) pressed = m;
  }
  std::vector<std::optional<ForceModel>> models(std::begin(kForceModels), std::end(kForceModels));
  models.emplace_back();
  for (const auto& model : models) RunEstimator(base, {model, 1}, stage, pressed, add);
  RunPushes(base, add);
  RunPressedSkin(base, add);
  return rows;
}

}  // namespace taclink
