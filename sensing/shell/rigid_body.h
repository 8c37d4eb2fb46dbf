#pragma once

#include <variant>

#include "sensing/core/geometry.h"

namespace taclink {

/// Rigid obstacles, link frame, mm. Directions are unit vectors.
struct RigidSphere {
  Vec3 center_mm;
  double radius_mm = 0;
};
/// All behind a plane.
struct RigidPlate {
  Vec3 point_mm;
  Vec3 outward;  ///< away from the plate's material, towards the skin
};
/// Endless round bar.
struct RigidBar {
  Vec3 point_mm;  ///< on its axis
  Vec3 axis;
  double radius_mm = 0;
};
/// Flat-ended round stamp, like a force probe; its rim is round, down to 60 degrees, and a cone further down.
struct RigidStamp {
  Vec3 face_center_mm;
  Vec3 axis;  ///< from the face towards the skin
  double radius_mm = 0;
  double rim_radius_mm = 0.25;  ///< of curvature
};
using RigidBody = std::variant<RigidSphere, RigidPlate, RigidBar, RigidStamp>;

/// Where a point is, seen from a body.
struct Gap {
  double distance_mm = 0;  ///< to its surface, of a stamp along its axis; negative: inside
  Vec3 normal;             ///< the distance's gradient, a unit vector but beside a stamp's face
  Mat3 curvature_per_mm;   ///< the gradient's derivative
};
Gap GapOf(const RigidBody& body, const Vec3& point_mm);
/// No point within `reach_mm` of this one can be inside the body.
bool IsBeyondReach(const RigidBody& body, const Vec3& point_mm, double reach_mm);

RigidBody Moved(const RigidBody& body, const Vec3& by_mm);
/// The body and all within `by_mm` of it.
RigidBody Grown(const RigidBody& body, double by_mm);
/// A point that moves with it.
Vec3 OriginOf(const RigidBody& body);

}  // namespace taclink
