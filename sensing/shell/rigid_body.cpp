#include "sensing/shell/rigid_body.h"

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

// How far a stamp's rim has fallen off at a distance beyond the flat part: along a circle at first, then
// straight on along its tangent.
struct Fall {
  double mm, slope, curvature_per_mm;
};
constexpr double kSteepest = 1.7320508075688772, kSteepestCosine = 0.5;  // 60 degrees
Fall FallOf(double rim_radius_mm, double out_mm) {
  const double edge = rim_radius_mm * kSteepestCosine * kSteepest;
  if (out_mm > edge)
    return {rim_radius_mm * (1 - kSteepestCosine) + kSteepest * (out_mm - edge), kSteepest, 0};
  const double left = std::sqrt(rim_radius_mm * rim_radius_mm - out_mm * out_mm);
  return {rim_radius_mm - left, out_mm / left, rim_radius_mm * rim_radius_mm / (left * left * left)};
}

// Height above the face, and above the rim's profile beyond the flat part: the side would throw out points
// that a long step has put deep behind the face.
Gap GapTo(const RigidStamp& s, const Vec3& p) {
  const Mat3 across = Mat3::Identity() - s.axis * s.axis.transpose();
  const Vec3 d = p - s.face_center_mm;
  const Gap side = RoundGap(across * d, s.radius_mm - s.rim_radius_mm, across, s.axis.unitOrthogonal());
  if (side.distance_mm <= 0) return {s.axis.dot(d), s.axis, Mat3::Zero()};
  const Fall fall = FallOf(s.rim_radius_mm, side.distance_mm);
  return {s.axis.dot(d) + fall.mm, s.axis + fall.slope * side.normal,
          fall.curvature_per_mm * side.normal * side.normal.transpose() + fall.slope * side.curvature_per_mm};
}

template <typename Shape>
Vec3& OriginIn(Shape& shape) {
  if constexpr (requires { shape.center_mm; }) {
    return shape.center_mm;
  } else if constexpr (requires { shape.face_center_mm; }) {
    return shape.face_center_mm;
  } else {
    return shape.point_mm;
  }
}

}  // namespace

Gap GapOf(const RigidBody& body, const Vec3& point_mm) {
  return std::visit([&](const auto& shape) { return GapTo(shape, point_mm); }, body);
}

bool IsBeyondReach(const RigidBody& body, const Vec3& point_mm, double reach_mm) {
  const auto* stamp = std::get_if<RigidStamp>(&body);
  if (!stamp) return GapOf(body, point_mm).distance_mm > reach_mm;
  const Vec3 d = point_mm - stamp->face_center_mm;
  const double up = stamp->axis.dot(d);
  if (up > reach_mm) return true;
  // No wider, as far down as the reach goes, than a cone of that slope from where the rim would end.
  const double widest = stamp->radius_mm + (reach_mm - up) / kSteepest;
  return (d - up * stamp->axis).norm() > widest + reach_mm;
}

RigidBody Moved(const RigidBody& body, const Vec3& by_mm) {
  return std::visit(
      [&](auto shape) -> RigidBody {
        OriginIn(shape) += by_mm;
        return shape;
      },
      body);
}

Vec3 OriginOf(const RigidBody& body) {
  return std::visit([](auto shape) -> Vec3 { return OriginIn(shape); }, body);
}

RigidBody Grown(const RigidBody& body, double by_mm) {
  return std::visit(
      [&](auto shape) -> RigidBody {
        if constexpr (requires { shape.rim_radius_mm; }) {
          shape.face_center_mm += by_mm * shape.axis;
          shape.rim_radius_mm += by_mm;
          shape.radius_mm += by_mm;
        } else if constexpr (requires { shape.outward; }) {
          shape.point_mm += by_mm * shape.outward;
        } else {
          shape.radius_mm += by_mm;
        }
        return shape;
      },
      body);
}

}  // namespace taclink
