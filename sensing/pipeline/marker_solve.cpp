#include "sensing/pipeline/marker_solve.h"

#include <utility>

#include "sensing/pipeline/judge.h"

namespace taclink {
namespace {

constexpr int kMostPasses = 4;
constexpr double kOutlierSigmas = 6;  // as CameraEvidenceOptions has it

// Markers that contradict the estimate. True: there was one more.
bool LeaveOutliersOut(const Eigen::VectorXd& by_cameras_mm, SkinShape& shape) {
  bool changed = false;
  for (size_t m = 0; m < shape.measured.size(); ++m) {
    MeasuredDisplacement& measured = shape.measured[m];
    const Mat3& information = measured.information_per_mm2;
    if (!(information.trace() > 0)) continue;
    // From the posterior, which has moved towards what neighbors agree on, by noise alone: no more than chi^2
    // of the error from what the others say.
    const Vec3 seen_mm =
        shape.displacements_mm[m] + by_cameras_mm.segment<3>(3 * static_cast<Eigen::Index>(m));
    const Vec3 error = measured.displacement_mm - seen_mm;
    if (error.dot(information * error) < kOutlierSigmas * kOutlierSigmas) continue;
    for (const CameraId id : kBothCameras) {
      const bool is_other =
          shape.sources[m] == (id == CameraId::kTop ? MarkerSource::kBottom : MarkerSource::kTop);
      if (!is_other) shape.rejected.push_back({id, static_cast<int>(m)});
    }
    measured = {};
    shape.sources[m] = MarkerSource::kInferred;
    changed = true;
  }
  return changed;
}

}  // namespace

LinkState SolveMarkers(const LinkModel& model, StateEstimator& estimator, LoadsPair loads, SkinShape shape,
                       bool is_pressure_measured) {
  LinkState state;
  state.shape = std::move(shape);
  ContactFinder finder(model);
  const SkinEstimate& estimate = estimator.estimate();
  if (!is_pressure_measured) {
    MarkerObservations seen;
    for (const MeasuredDisplacement& measured : state.shape.measured) {
      seen.displacement_mm.push_back(measured.displacement_mm);
      seen.information.push_back(measured.information_per_mm2);
    }
    loads.now = estimator.PressureFromShape(seen, loads);
  }
  for (int pass = 0; pass < kMostPasses; ++pass) {
    estimator.Estimate(loads, state.shape, state.forces);
    // Of the last pass nothing is left out, for it is in the answer.
    const bool is_last = pass + 1 == kMostPasses;
    if (estimate.failure != EstimateFailure::kNone || is_last ||
        !LeaveOutliersOut(estimate.loads.by_cameras_mm, state.shape))
      break;
    estimator.skin().BeginAgain();
  }
  estimator.FindContacts(finder, state.shape, state.forces, state.contacts);
  for (const Contact& contact : state.contacts) state.total_force_n += contact.force_n;
  estimator.WriteKnownLoads(state);
  Judge({.model = model,
         .camera_trouble = {},
         .agreement = {},
         .motion = {},
         .sees_alone = {},
         .drift = {},
         .measured = loads.now,
         .is_pressure_measured = is_pressure_measured,
         .baseline = loads.baseline,
         .estimate = estimate},
        state);
  return state;
}

}  // namespace taclink
