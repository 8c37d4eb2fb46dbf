#include "sensing/camera/triangulation.h"

namespace taclink {

std::optional<Vec3> SightRay::AtZ(double z_mm) const {
  if (direction.z() == 0) return std::nullopt;
  const double t = (z_mm - origin.z()) / direction.z();
  if (t <= 0) return std::nullopt;
  return Vec3(origin + t * direction);
}

std::optional<RayMeeting> MeetRays(const SightRay& a, const SightRay& b) {
  // Normal equations of min |a.origin + s a.direction - b.origin - t b.direction|.
  const Vec3 between = b.origin - a.origin;
  const double cosine = a.direction.dot(b.direction);
  const double determinant = 1 - cosine * cosine;
  if (determinant < 1e-9) return std::nullopt;
  const double along_a = between.dot(a.direction), along_b = between.dot(b.direction);
  const double s = (along_a - cosine * along_b) / determinant;
  const double t = (cosine * along_a - along_b) / determinant;
  if (s <= 0 || t <= 0) return std::nullopt;
  const Vec3 on_a = a.origin + s * a.direction, on_b = b.origin + t * b.direction;
  return RayMeeting{0.5 * (on_a + on_b), (on_a - on_b).norm()};
}

}  // namespace taclink
