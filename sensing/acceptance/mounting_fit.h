#pragma once

#include <array>
#include <optional>
#include <vector>

#include "sensing/acceptance/statistics.h"
#include "sensing/core/geometry.h"

namespace taclink {

/// A place of contact: the reference, and the link's measurement at the reference's distance from the axis
/// (AtRadiusOf). Link frame, mm.
struct PlacePair {
  int place = 0;  ///< same number: same place
  Vec3 reference_mm = Vec3::Zero(), measured_mm = Vec3::Zero();
};

/// Small rigid motion from reference places to measured ones: an error of the link's pose, or of the path
/// numbering.
struct MountingFit {
  std::array<Estimate, 3> rotation_rad;  ///< about x, y, z through the centroid of the places
  std::array<Estimate, 3> shift_mm;      ///< along x, y, z
};

/// Linear least squares over places (each place's mean is one sample), along the skin only: a load shifts its
/// contact inward, which is not an error of place. Components that the places do not determine have no
/// half-width. None: fewer than four places, or one on the axis.
std::optional<MountingFit> FitMounting(const std::vector<PlacePair>& pairs);

}  // namespace taclink
