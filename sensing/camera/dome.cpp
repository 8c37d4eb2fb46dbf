#include "sensing/camera/dome.h"

#include <algorithm>

namespace taclink {

Vec3 SeenOfDome(const Vec3& center_mm, const Vec3& inward, double rise_mm, const Vec3& camera_mm) {
  const Vec3 foot = center_mm - rise_mm * inward;
  const Vec3 to_camera = (camera_mm - foot).normalized();
  const double facing = std::clamp(inward.dot(to_camera), 0.0, 1.0);
  const Vec3 across = inward - inward.dot(to_camera) * to_camera;
  const double length = across.norm();
  return length > 1e-9 ? Vec3(foot + rise_mm * (1 - facing) / length * across) : foot;
}

}  // namespace taclink
