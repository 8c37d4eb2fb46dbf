#include "sensing/mechanics/rigid_body.h"

#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

constexpr double kTiny = 1e-12;

// Distance to a point or an axis less the radius; `away` from it, in the space that `projector` leaves.
Gap RoundGap(const Vec3& away, double radius_mm, const Mat3& projector, const Vec3& fallback) {
  const double length = away.norm();
  const Vec3 normal = length > kTiny ? Vec3(away / length) : fallback;
  const double curvature = 1 / std::max(length, kTiny);
  return {length - radius_mm, normal, curvature * (projector - normal * normal.transpose())};
}

Gap GapTo(const RigidSphere& s, const Vec3& p) {
  return RoundGap(p - s.center_mm, s.radius_mm, Mat3::Identity(), Vec3::UnitZ());
}

Gap GapTo(const RigidPlate& s, const Vec3& p) {
  return {s.outward.dot(p - s.point_mm), s.outward, Mat3::Zero()};
}

Gap GapTo(const RigidBar& s, const Vec3& p) {
  const Mat3 across = Mat3::Identity() - s.axis * s.axis.transpose();
  return RoundGap(across * (p - s.point_mm), s.radius_mm, across, s.axis.unitOrthogonal());
}

// In the plane through the axis: a box with a rounded corner, `out` beyond the flat part, `up` before the
// rim's centre.
Gap GapTo(const RigidStamp& s, const Vec3& p) {
  const Mat3 across = Mat3::Identity() - s.axis * s.axis.transpose();
  const Vec3 d = p - s.face_center_mm;
  const double up = s.axis.dot(d) + s.rim_radius_mm;
  const Gap side = RoundGap(across * d, s.radius_mm - s.rim_radius_mm, across, s.axis.unitOrthogonal());
  const double out = side.distance_mm;
  if (out <= 0 || up <= 0) {
    if (up >= out) return {up - s.rim_radius_mm, s.axis, Mat3::Zero()};
    return {out - s.rim_radius_mm, side.normal, side.curvature_per_mm};
  }
  const double length = std::hypot(out, up);
  const Vec3 normal = (out * side.normal + up * s.axis) / length;
  const Mat3 curvature = (side.normal * side.normal.transpose() + out * side.curvature_per_mm +
                          s.axis * s.axis.transpose() - normal * normal.transpose()) /
                         length;
  return {length - s.rim_radius_mm, normal, curvature};
}

}  // namespace

Gap GapOf(const RigidBody& body, const Vec3& point_mm) {
  return std::visit([&](const auto& shape) { return GapTo(shape, point_mm); }, body);
}

RigidBody Moved(const RigidBody& body, const Vec3& by_mm) {
  return std::visit(
      [&](auto shape) -> RigidBody {
        if constexpr (requires { shape.center_mm; }) {
          shape.center_mm += by_mm;
        } else if constexpr (requires { shape.face_center_mm; }) {
          shape.face_center_mm += by_mm;
        } else {
          shape.point_mm += by_mm;
        }
        return shape;
      },
      body);
}

}  // namespace taclink
