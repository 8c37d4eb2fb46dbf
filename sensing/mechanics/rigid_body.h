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
/// Flat-ended round stamp, like a force probe; its rim is rounded.
struct RigidStamp {
  Vec3 face_center_mm;
  Vec3 axis;  ///< from the face towards the skin
  double radius_mm = 0;
  double rim_radius_mm = 0.25;
};
using RigidBody = std::variant<RigidSphere, RigidPlate, RigidBar, RigidStamp>;

/// Where a point is, seen from a body.
struct Gap {
  double distance_mm = 0;  ///< to its surface; negative: inside
  Vec3 normal;             ///< unit, the distance's gradient
  Mat3 curvature_per_mm;   ///< the gradient's derivative
};
Gap GapOf(const RigidBody& body, const Vec3& point_mm);

RigidBody Moved(const RigidBody& body, const Vec3& by_mm);

}  // namespace taclink
