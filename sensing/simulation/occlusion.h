#pragma once

#include "sensing/core/geometry.h"
#include "sensing/simulation/skin_truth.h"

namespace taclink {

/// Does the wall stand between a point inside the skin and a camera? The wall is taken straight between the
/// grid's points. A wall within `slack_mm` of the line of sight does not count.
bool IsHidden(const RadiusGrid& wall, const Vec3& point_mm, const Vec3& camera_mm, double slack_mm);

}  // namespace taclink
