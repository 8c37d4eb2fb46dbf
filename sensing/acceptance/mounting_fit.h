#pragma once

#include <array>
#include <optional>
#include <vector>

#include "sensing/acceptance/statistics.h"
#include "sensing/core/geometry.h"

namespace taclink {

/// A place that something touched: by the reference, and as the link has it, at the reference's distance from
/// the axis (AtRadiusOf). Link frame, mm.
struct PlacePair {
  int place = 0;  ///< pairs with the same number were at the same place
  Vec3 reference_mm = Vec3::Zero(), measured_mm = Vec3::Zero();
};

/// The small rigid motion that carries reference places to measured ones: how the link frame is mounted off
/// from where the references have it, or how its markers are numbered off.
struct MountingFit {
  std::array<Estimate, 3> rotation_rad;  ///< about x, y, z through the center of the places
  std::array<Estimate, 3> shift_mm;      ///< along x, y, z
};

/// Linear least squares over places (the mean of each place's pairs is one sample), along the skin only: a
/// load presses its contact inwards, which is no error of the place. Components that the places do not
/// determine have no width. None: fewer than four places, or one on the axis.
std::optional<MountingFit> FitMounting(const std::vector<PlacePair>& pairs);

}  // namespace taclink
