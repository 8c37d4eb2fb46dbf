#pragma once

#include "sensing/core/geometry.h"

namespace taclink {

/// The point of a dome (half a ball on the wall) whose projection is the centre of what `camera_mm` sees of
/// it. A dome looks like a half disc from the side, and like a disc about its foot from above: its outline's
/// centroid stands (1 - c) h off the foot, across the line of sight, where c is the cosine between that and
/// the wall's normal `inward`, and h = 4 r / (3 pi) is how far `center_mm` is off the wall: `rise_mm`.
Vec3 SeenOfDome(const Vec3& center_mm, const Vec3& inward, double rise_mm, const Vec3& camera_mm);

}  // namespace taclink
