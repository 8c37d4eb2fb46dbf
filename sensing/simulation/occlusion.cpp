#include "sensing/simulation/occlusion.h"

#include <cmath>

namespace taclink {
namespace {

double WallRadius(const RadiusGrid& wall, size_t row, double angle_rad) {
  const double turns = (angle_rad - wall.first_angle_rad) / (2 * kPi);
  const double column = (turns - std::floor(turns)) * wall.columns;
  const int left = static_cast<int>(column) % wall.columns, right = (left + 1) % wall.columns;
  const double share = column - std::floor(column);
  const double* radius = wall.radius_mm.data() + row * static_cast<size_t>(wall.columns);
  return (1 - share) * radius[left] + share * radius[right];
}

}  // namespace

bool IsHidden(const RadiusGrid& wall, const Vec3& point_mm, const Vec3& camera_mm, double slack_mm) {
  const Vec3 way = camera_mm - point_mm;
  if (way.z() == 0) return false;
  for (size_t row = 0; row < wall.z_mm.size(); ++row) {
    const double t = (wall.z_mm[row] - point_mm.z()) / way.z();
    if (!(t > 0 && t < 1)) continue;
    const double x = point_mm.x() + t * way.x(), y = point_mm.y() + t * way.y();
    const double radius2 = x * x + y * y;
    const double nearest = wall.row_min_mm[row] + slack_mm;
    if (radius2 <= nearest * nearest) continue;  // cheap, and true for almost all
    if (std::sqrt(radius2) > WallRadius(wall, row, std::atan2(y, x)) + slack_mm) return true;
  }
  return false;
}

}  // namespace taclink
