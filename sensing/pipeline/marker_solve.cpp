#include "sensing/pipeline/marker_solve.h"

#include <utility>

#include "sensing/pipeline/judge.h"

namespace taclink {
namespace {

constexpr int kMostPasses = 4;
constexpr double kOutlierSigmas = 6;  // as CameraEvidenceOptions has it

// Markers that contradict the estimate. True: there was one more.
bool LeaveOutliersOut(SkinShape& shape) {
  bool changed = false;
  for (size_t m = 0; m < shape.measured.size(); ++m) {
    MeasuredDisplacement& measured = shape.measured[m];
    const Mat3& information = measured.information_per_mm2;
    if (!(information.trace() > 0)) continue;
    // From the posterior, which has moved towards what neighbors agree on, by noise alone: no more than chi^2
    // of the error from what the others say.
    const Vec3 error = measured.displacement_mm - shape.displacements_mm[m];
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

LinkState SolveMarkers(const LinkModel& model, StateEstimator& estimator, const PressurePair& pressure,
                       SkinShape shape) {
  LinkState state;
  state.shape = std::move(shape);
  ContactFinder finder(model);
  const SkinEstimate& estimate = estimator.estimate();
  for (int pass = 0; pass < kMostPasses; ++pass) {
    estimator.Estimate(pressure, state.shape, state.forces);
    // Of the last pass nothing is left out, for it is in the answer.
    const bool is_last = pass + 1 == kMostPasses;
    if (estimate.failure != EstimateFailure::kNone || is_last || !LeaveOutliersOut(state.shape)) break;
    estimator.skin().BeginAgain();
  }
  estimator.FindContacts(finder, state.shape, state.forces, state.contacts);
  for (const Contact& contact : state.contacts) state.total_force_n += contact.force_n;
  if (state.forces.converged)
    state.pressure_estimate = {estimate.pressure_mpa, estimate.loads.pressure_sigma_mpa};
  Judge({.model = model,
         .camera_trouble = "",
         .drift_advice = "",
         .told = pressure.now,
         .baseline = pressure.baseline,
         .estimate = estimate},
        state);
  return state;
}

}  // namespace taclink
