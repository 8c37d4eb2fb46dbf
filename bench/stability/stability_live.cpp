#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>

#include "bench/force/accuracy_bench.h"
#include "bench/stability/stability_cases.h"
#include "sensing/pipeline/marker_solve.h"

namespace taclink {
namespace {

constexpr double kLiveForceShare = 0.1, kLiveForceN = 0.03, kLiveCenterMm = 4, kLivePhantomMm = 8,
                 kLiveMarkerRmsMm = 0.3, kLiveDeviations = 3;
constexpr PressKind kKinds[] = {PressKind::kRest, PressKind::kSphereMarker, PressKind::kTwo,
                                PressKind::kPlate};
constexpr double kLiveDepthMm = 5;
constexpr double kUsualLengthMm = 198;

// Of the truth's mesh: elements must follow what decays over sqrt(R t).
int TruthRefinement(const LinkModel& model) {
  constexpr double kFineUnit = 0.5;
  return UnitsOf(model).length < kFineUnit * model.length_mm / kUsualLengthMm ? 4 : 2;
}

// What was found of a body's contact: of a plate on an inflated skin, several hills where its edge presses.
struct Found {
  Vec3 force_n = Vec3::Zero(), center_mm = Vec3::Zero();
  Mat3 covariance_n2 = Mat3::Zero();
  double normal_n = 0;

  void Add(const Contact& contact) {
    force_n += contact.force_n;
    center_mm += contact.normal_force_n * contact.center_mm;
    normal_n += contact.normal_force_n;
    covariance_n2 += contact.force_covariance_n2.value_or(Mat3::Zero());
  }
};

class Faults {
 public:
  Faults(const SkinCase& skin, const PressPath& path, const TrueStage& truth, const LinkState& state)
      : model_(skin.model), unit_(UnitsOf(skin.model)), path_(path), truth_(truth), state_(state) {
    std::vector<Found> found(path.bodies.size());
    for (const Contact& contact : state.contacts) {
      if (const auto body = BodyAt(contact)) {
        found[*body].Add(contact);
      } else if (contact.normal_force_n > kLiveForceN * unit_.force) {
        Add("phantom of %.3g N", contact.normal_force_n);
      }
    }
    for (size_t i = 0; i < found.size(); ++i) CheckBody(truth.contacts[i], found[i]);
    CheckShape();
  }
  const std::string& text() const { return text_; }

 private:
  void Add(const char* format, double a, double b = 0) {
    char text[120];
    std::snprintf(text, sizeof text, format, a, b);  // NOLINT(clang-diagnostic-format-nonliteral)
    text_ += (text_.empty() ? "" : ", ") + std::string(text);
  }

  // The body whose surface the contact's center is nearest to; none is near: a phantom.
  std::optional<size_t> BodyAt(const Contact& contact) const {
    std::optional<size_t> nearest;
    double least = kLivePhantomMm * unit_.length;
    for (size_t i = 0; i < path_.bodies.size(); ++i) {
      const PressBody& body = path_.bodies[i];
      const RigidBody there = Moved(body.touching, body.Offset(truth_.stage.depth_mm, truth_.stage.drag_mm));
      const double distance = std::min(std::abs(GapOf(there, contact.center_mm).distance_mm),
                                       truth_.contacts[i].DistanceTo(contact.center_mm));
      if (distance < least) least = distance, nearest = i;
    }
    return nearest;
  }

  // Within a tenth, or three of the standard deviations that are told: what is told to be uncertain is no
  // silent error.
  void CheckBody(const BodyContact& truth, const Found& found) {
    const Vec3 error = found.force_n - truth.force_n;
    const double off = error.norm(), force = truth.force_n.norm();
    if (off > std::max(kLiveForceN * unit_.force, kLiveForceShare * force)) {
      const Mat3 covariance = found.covariance_n2 + 1e-12 * unit_.force * unit_.force * Mat3::Identity();
      const double deviations = std::sqrt(error.dot(covariance.ldlt().solve(error)));
      if (!(deviations <= kLiveDeviations)) Add("force off by %.3g N of %.3g N", off, force);
    }
    if (found.normal_n <= 0) return;
    const double away = truth.DistanceTo(found.center_mm / found.normal_n);
    if (away > kLiveCenterMm * unit_.length) Add("center off by %.2g mm", away);
  }

  void CheckShape() {
    double sum2 = 0;
    for (int m = 0; m < model_.markers.count(); ++m) {
      const auto i = static_cast<size_t>(m);
      const Vec3 at = model_.RestMarker(m) + truth_.displacements_mm[i];
      sum2 += (state_.shape.positions_mm[i] - at).squaredNorm();
    }
    const double rms = std::sqrt(sum2 / model_.markers.count());
    if (!(rms <= kLiveMarkerRmsMm * unit_.length)) Add("markers off by %.2g mm RMS", rms);
  }

  const LinkModel& model_;
  const SkinUnits unit_;
  const PressPath& path_;
  const TrueStage& truth_;
  const LinkState& state_;
  std::string text_;
};

StabilityRow LiveVerdict(const std::string& name, const std::string& faults, const LinkState& state) {
  StabilityRow row{name, Ending::kRight, faults, kNan, kNan, kNan, kNan, kNan};
  const std::string reasons = ReasonsOf(state);
  if (faults.empty())
    row.reason = reasons.empty() ? "ok" : "right, although it says: " + reasons;
  else if (!reasons.empty())
    row.ending = Ending::kRefused, row.reason = "it says: " + reasons + " (" + faults + ")";
  else
    row.ending = Ending::kWrong, row.reason = "ok, but " + faults;
  return row;
}

PressPath PathOf(const SkinCase& skin, PressKind kind, const Vec3& specific_force_mps2) {
  const double unit = UnitsOf(skin.model).length;
  PressPath path = MakePressPath(skin.model, kind, skin.pressure_mpa, unit);
  if (!path.stages.empty()) path.stages = {{kLiveDepthMm * unit, 0}};
  return skin.specific_force_mps2.isZero(0) ? path : WithWeight(path, "held", specific_force_mps2);
}

StabilityRow NoTruth(const std::string& name, const PathTruth& truth) {
  return {name, Ending::kRefused, "the skin itself: " + truth.failure, kNan, kNan, kNan, kNan, kNan};
}

StabilityRow Show(const SkinCase& skin, const PathTruth& truth, const TrueStage& stage, uint64_t seed,
                  const std::string& name, StateEstimator& estimator) {
  SkinShape shape;
  MakeShape(skin.model, stage, kNoiseMm * UnitsOf(skin.model).length, seed, shape);
  const LinkState state = SolveMarkers(skin.model, estimator,
                                       LoadsOf(truth.path, skin.pressure_sigma_mpa, seed), std::move(shape));
  const bool answers = state.forces.converged && !state.shape.positions_mm.empty();
  return LiveVerdict(name, answers ? Faults(skin, truth.path, stage, state).text() : "no answer", state);
}

// The skin without and with bodies, each once, by an estimator that knows nothing of what was before.
std::vector<StabilityRow> RunPath(const SkinCase& skin, PressKind kind) {
  const PressPath path = PathOf(skin, kind, skin.specific_force_mps2);
  const std::string name = skin.name + ", " + Name(kind);
  const PathTruth truth = SolvePath(skin.model, path, TruthRefinement(skin.model));
  if (!truth.failure.empty() || truth.inflated.displacements_mm.empty()) return {NoTruth(name, truth)};
  const auto estimator = MakeStateEstimator(skin.model, {});
  std::vector<StabilityRow> rows;
  for (const TrueStage& stage : truth.stages.empty() ? std::vector{truth.inflated} : truth.stages) {
    estimator->Restart();
    rows.push_back(Show(skin, truth, stage, 1, name, *estimator));
  }
  return rows;
}

// Nothing touches the skin, which turns about the link's X axis by an eighth of a turn from frame to frame.
// The worst of the frames.
StabilityRow RunTurning(const SkinCase& skin) {
  constexpr int kAttitudes = 8;
  const std::string name = skin.name + ", turned 45 deg a frame";
  const auto estimator = MakeStateEstimator(skin.model, {});
  StabilityRow worst{name, Ending::kRight, "ok", kNan, kNan, kNan, kNan, kNan};
  for (int i = 0; i < kAttitudes; ++i) {
    const double angle = 2 * kPi * i / kAttitudes;
    const Vec3 down(0, -std::sin(angle), -std::cos(angle));
    const PressPath path = PathOf(skin, PressKind::kRest, skin.specific_force_mps2.norm() * down);
    const PathTruth truth = SolvePath(skin.model, path, TruthRefinement(skin.model));
    if (!truth.failure.empty()) return NoTruth(name, truth);
    const StabilityRow row =
        Show(skin, truth, truth.inflated, static_cast<uint64_t>(i) + 1, name, *estimator);
    if (row.ending > worst.ending) worst = row;
  }
  return worst;
}

}  // namespace

std::vector<StabilityRow> RunLiveCase(const SkinCase& skin) {
  std::vector<StabilityRow> rows;
  for (const PressKind kind : kKinds) {
    for (StabilityRow& row : RunPath(skin, kind)) rows.push_back(std::move(row));
  }
  if (!skin.specific_force_mps2.isZero(0)) rows.push_back(RunTurning(skin));
  return rows;
}

}  // namespace taclink
