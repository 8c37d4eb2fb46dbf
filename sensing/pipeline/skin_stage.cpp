#include "sensing/pipeline/skin_stage.h"

#include <algorithm>

#include "sensing/core/similar_skin.h"
#include "sensing/pipeline/judge.h"

namespace taclink {
namespace {

constexpr int kMostPasses = 4;
// In LengthUnit: of the points that cameras see of the markers; of a marker that one camera sees, from where
// its ray was linearized.
constexpr double kSameLookMm = 0.1, kSamePlaceMm = 0.25;

MarkerSource SourceOf(bool top, bool bottom) {
  if (top) return bottom ? MarkerSource::kBoth : MarkerSource::kTop;
  return bottom ? MarkerSource::kBottom : MarkerSource::kInferred;
}

}  // namespace

SkinStage::SkinStage(const LinkModel& model, const CalibrationSummary& calibration,
                     const CameraEvidenceOptions& options, double noise_px)
    : model_(model),
      length_unit_(LengthUnit(model)),
      evidence_(model, calibration.rig, options),
      rest_(model, calibration.rig, noise_px),
      doubt_(model, calibration.rig, calibration.covariance),
      baseline_mm_(Eigen::VectorXd::Zero(3 * model.markers.count())),
      about_mm_(baseline_mm_) {}

void SkinStage::TakeBaseline(const LabelledMarkers& markers, const MeasuredLoads& loads,
                             const Eigen::VectorXd& untouched_mm, const Eigen::VectorXd& residual_mm,
                             bool keep_unseen) {
  baseline_loads_ = loads;
  baseline_mm_ = about_mm_ = untouched_mm;
  if (residual_mm.size() == untouched_mm.size()) about_mm_ += residual_mm;
  evidence_.SetBaseline(markers, about_mm_, keep_unseen);
  rest_.SetBaseline(markers);
}

void SkinStage::SetBaseline(const LabelledMarkers& rest, const MeasuredLoads& loads,
                            const Eigen::VectorXd& untouched_mm, const Eigen::VectorXd& residual_mm) {
  TakeBaseline(rest, loads, untouched_mm, residual_mm, false);
}

void SkinStage::Tare(const LabelledMarkers& now, const MeasuredLoads& loads,
                     const Eigen::VectorXd& untouched_mm, const Eigen::VectorXd& residual_mm) {
  TakeBaseline(now, loads, untouched_mm, residual_mm, true);
}

void SkinStage::Measure(const Eigen::VectorXd& about_mm, std::span<const Vec3> drift_mm, SkinShape& shape) {
  evidence_.Measure(about_mm, observed_);
  const auto count = static_cast<size_t>(model_.markers.count());
  shape.measured.resize(count);
  shape.sources.resize(count);
  for (size_t m = 0; m < count; ++m) {
    const auto marker = static_cast<int>(m);
    Vec3& moved = observed_.displacement_mm[m];
    moved -= baseline_mm_.segment<3>(3 * static_cast<Eigen::Index>(m));
    if (!drift_mm.empty()) moved -= drift_mm[m];
    shape.measured[m] = {moved, observed_.information[m]};
    shape.sources[m] =
        SourceOf(evidence_.Uses(marker, CameraId::kTop), evidence_.Uses(marker, CameraId::kBottom));
  }
}

void SkinStage::CompareWithRest(const LabelledMarkers& markers, std::span<const Vec3> drift_mm,
                                const SkinEstimate& estimate) {
  sees_alone_.reset();
  const auto size = 3 * static_cast<Eigen::Index>(model_.markers.count());
  if (estimate.failure != EstimateFailure::kNone || estimate.untouched_mm.size() != size ||
      estimate.baseline_mm.size() != size)
    return;
  for (const CameraId id : kBothCameras) {
    const Eigen::VectorXd& by_camera_mm = estimate.loads.by_camera_mm[Index(id)];
    std::vector<Vec3>& expected_mm = expected_mm_[Index(id)];
    expected_mm.resize(static_cast<size_t>(model_.markers.count()));
    for (size_t m = 0; m < expected_mm.size(); ++m) {
      const auto at = 3 * static_cast<Eigen::Index>(m);
      expected_mm[m] = estimate.untouched_mm.segment<3>(at) - estimate.baseline_mm.segment<3>(at);
      if (by_camera_mm.size() == size) expected_mm[m] += by_camera_mm.segment<3>(at);
      if (!drift_mm.empty()) expected_mm[m] += drift_mm[m];
    }
  }
  sees_alone_ = rest_.SeesAlone(markers, expected_mm_);
}

void SkinStage::FindResiduals(std::span<const Vec3> drift_mm, const SkinEstimate& estimate) {
  for (auto& camera : residuals_) camera.clear();
  const auto size = 3 * static_cast<Eigen::Index>(model_.markers.count());
  if (estimate.failure != EstimateFailure::kNone || estimate.loads.beside_mm.size() != size) return;
  now_mm_ = estimate.displacements_mm - estimate.loads.beside_mm;
  for (size_t m = 0; m < drift_mm.size(); ++m)
    now_mm_.segment<3>(3 * static_cast<Eigen::Index>(m)) += drift_mm[m];
  evidence_.Residuals(now_mm_, residuals_);
}

void SkinStage::Run(const LabelledMarkers& markers, const std::optional<MeasuredLoads>& pressure,
                    std::span<const Vec3> drift_mm, StateEstimator& estimator, ContactFinder& finder,
                    LinkState& state, MeasuredLoads& told) {
  SkinShape& shape = state.shape;
  evidence_.Observe(markers);
  const auto count = static_cast<size_t>(model_.markers.count());
  for (int pass = 0; pass < kMostPasses; ++pass) {
    Measure(about_mm_, drift_mm, shape);
    // Nothing would be shown of what took long to find.
    if (pass == 0 && (shape.seen() < kLostShare * model_.markers.count() || !AreOfOneSkin(agreement()))) {
      estimator.GiveUp({told, baseline_loads_}, shape, state.forces);
      about_mm_ = baseline_mm_;
      break;
    }
    if (pressure) {
      told = *pressure;
    } else if (pass == 0) {
      told = estimator.PressureFromShape(observed_, {baseline_loads_, baseline_loads_});
    }
    estimator.Estimate({told, baseline_loads_}, shape, state.forces);
    const SkinEstimate& estimate = estimator.estimate();
    if (estimate.failure != EstimateFailure::kNone) {
      about_mm_ = estimate.has_shape ? estimate.displacements_mm : baseline_mm_;
      break;
    }
    Eigen::VectorXd& now = now_mm_;
    now = estimate.displacements_mm + estimate.loads.by_cameras_mm;  // as they are seen
    for (size_t m = 0; m < drift_mm.size(); ++m)
      now.segment<3>(3 * static_cast<Eigen::Index>(m)) += drift_mm[m];
    model_covariances_.resize(count);
    double moved_mm = 0;
    for (size_t m = 0; m < count; ++m) {
      const auto at = 3 * static_cast<Eigen::Index>(m);
      model_covariances_[m] = estimator.skin().loads().ModelCovariance(static_cast<int>(m));
      if (shape.sources[m] == MarkerSource::kTop || shape.sources[m] == MarkerSource::kBottom)
        moved_mm = std::max(moved_mm, (now - about_mm_).segment<3>(at).norm());
    }
    about_mm_ = now;
    if (pass + 1 == kMostPasses) break;  // what is in the answer is not left out any more
    const bool reconsidered = evidence_.Reconsider(now, model_covariances_);
    const bool looks_otherwise = evidence_.UpdateLooks(now) > kSameLookMm * length_unit_;
    if (!reconsidered && !looks_otherwise && moved_mm < kSamePlaceMm * length_unit_) break;
    if (reconsidered)
      estimator.skin().BeginAgain();
    else
      estimator.skin().Continue();
  }
  CompareWithRest(markers, drift_mm, estimator.estimate());
  FindResiduals(drift_mm, estimator.estimate());
  estimator.FindContacts(finder, shape, state.forces, state.contacts);
  shape.rejected.clear();
  for (size_t m = 0; m < count; ++m) {
    shape.covariances_mm2[m] += doubt_.Of(m, shape.displacements_mm[m]);
    for (const CameraId id : kBothCameras) {
      if (evidence_.IsDropped(static_cast<int>(m), id)) shape.rejected.push_back({id, static_cast<int>(m)});
    }
  }
}

}  // namespace taclink
