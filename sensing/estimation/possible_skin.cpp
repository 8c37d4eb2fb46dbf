// What physics forbids: the part of SkinEstimator that no answer gets past.
#include <algorithm>
#include <cmath>

#include "sensing/estimation/skin_estimator.h"

namespace taclink {
namespace {

constexpr double kSlackMm = 2;  // in length units: markers and tube are nowhere exact

}  // namespace

// No marker inside the tube, beyond an end or twice the radius, and no number that is not finite.
bool SkinEstimator::IsPossible(const SkinEstimate& estimate) const {
  if (!estimate.displacements_mm.allFinite() || !estimate.known_loads.Stacked().allFinite()) return false;
  const LinkModel& model = mechanics_.model();
  const double slack_mm = kSlackMm * mechanics_.length_unit();
  for (int m = 0; m < mechanics_.marker_count(); ++m) {
    const Vec3 rest = model.RestMarker(m), at = rest + estimate.displacements_mm.segment<3>(3 * m);
    const double radius_mm = at.head<2>().norm();
    if (radius_mm > 2 * rest.head<2>().norm() || radius_mm < model.tube_outer_radius_mm - slack_mm)
      return false;
    if (at.z() < -slack_mm || at.z() > model.length_mm + slack_mm) return false;
  }
  return std::all_of(estimate.loads.loads.begin(), estimate.loads.loads.end(), [](const EstimatedLoad& load) {
    return load.force_n.allFinite() && load.force_covariance_n2.allFinite() && load.center.allFinite();
  });
}

}  // namespace taclink
