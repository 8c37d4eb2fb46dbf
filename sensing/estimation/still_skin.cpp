// Frames of a skin that nothing touches: the part of SkinEstimator that need not solve anything.
#include <algorithm>

#include "sensing/estimation/skin_estimator.h"

namespace taclink {
namespace {

// Below what any load has to explain (kHillGain of LoadEstimator): 3 x 3 markers show two thirds of a load.
constexpr double kStillMarkerChi2 = 20, kStillSumChi2 = 12;

}  // namespace

// The markers are where the skin without loads has them, but for the cameras' noise: each by itself, over
// each 3 x 3 of them, and over each ring, radially. A load that explains less than that would not be let in
// (kHillGain of LoadEstimator), so nothing has to be solved. True: the estimate is complete. Allocates
// nothing.
bool SkinEstimator::IsStill(const SkinObservation& observation, const InflatedSkin& inflated,
                            const PressurePrior& prior, SkinEstimate& estimate) {
  Tangent& tangent = *still_;
  if (options_.model == ForceModel::kLinear || !tangent.is_prepared || !tangent.IsNear(inflated.state) ||
      !tangent.loads.IsPreparedFor(observation.markers, prior))
    return false;
  double told = 1 / (prior.sigma_mpa * prior.sigma_mpa), off = 0;
  for (int m = 0; m < mechanics_.marker_count(); ++m) {
    const Mat3& information = observation.markers.information[static_cast<size_t>(m)];
    const Vec3 error = observation.markers.displacement_mm[static_cast<size_t>(m)] +
                       estimate.baseline_mm.segment<3>(3 * m) - inflated.markers_mm.segment<3>(3 * m);
    if (!(error.dot(information * error) <= kStillMarkerChi2)) return false;
    const auto node = static_cast<size_t>(mechanics_.markers().node(m));
    const Vec3 weighed = information * mechanics_.mesh().normals[node];
    radial_pull_[m] = weighed.dot(error);
    radial_weight_[m] = weighed.dot(mechanics_.mesh().normals[node]);
    const Vec3 by = information * inflated.markers_mm_per_mpa.segment<3>(3 * m);
    told += by.dot(inflated.markers_mm_per_mpa.segment<3>(3 * m));
    off += by.dot(error);
  }
  if (!AreNeighborsStill()) return false;
  used_ = &tangent;
  Forget();
  estimate.loads.loads.clear();
  estimate.loads.chi2_per_dof = estimate.loads.region_chi2_per_dof = estimate.loads.camera_shift_mm = 0;
  estimate.loads.converged = true;
  estimate.loads.pressure_error_mpa = off / told;
  estimate.loads.baseline_error_mpa = 0;
  estimate.loads.pressure_sigma_mpa = prior.sigma_mpa;
  estimate.state = inflated.state;
  estimate.displacements_mm = inflated.markers_mm + off / told * inflated.markers_mm_per_mpa;
  estimate.pressure_mpa = inflated.pressure_mpa + off / told;
  estimate.model = options_.model.value_or(ForceModel::kPressurised);
  estimate.failure = EstimateFailure::kNone;
  return true;
}

bool SkinEstimator::AreNeighborsStill() const {
  const LinkModel& model = mechanics_.model();
  const int paths = model.markers.paths, rings = model.markers.rings();
  for (int ring = 0; ring < rings; ++ring) {
    double ring_pull = 0, ring_weight = 0;
    for (int path = 0; path < paths; ++path) {
      double pull = 0, weight = 0;
      for (int r = std::max(0, ring - 1); r <= std::min(rings - 1, ring + 1); ++r) {
        for (int p = path - 1; p <= path + 1; ++p) {
          const int m = model.MarkerIndex((p + paths) % paths, r);
          pull += radial_pull_[m];
          weight += radial_weight_[m];
        }
      }
      if (pull * pull > kStillSumChi2 * weight) return false;
      ring_pull += radial_pull_[model.MarkerIndex(path, ring)];
      ring_weight += radial_weight_[model.MarkerIndex(path, ring)];
    }
    if (ring_pull * ring_pull > kStillSumChi2 * ring_weight) return false;
  }
  return true;
}

}  // namespace taclink
