#pragma once

#include <optional>
#include <string>

#include "sensing/core/geometry.h"
#include "sensing/core/known_loads.h"

namespace taclink {

/// Of a joint: angle, and its first and second derivatives by time.
struct JointMotion {
  double rad = 0, radps = 0, radps2 = 0;
};

/// A swing about an axis that is fixed in the room and in the link: the angle at time t is
/// mean - amplitude cos(2 pi t / period), so that it begins and ends at rest.
struct Swing {
  Vec3 axis = Vec3::UnitX();     ///< unit, link frame
  Vec3 pivot_mm = Vec3::Zero();  ///< a point of the axis, link frame
  double mean_rad = 0;
  double amplitude_rad = 0;
  double period_s = 1;
  std::string joint = {};  ///< of the arm's URDF, which turns by that angle; may be empty

  JointMotion At(double time_s) const;
};

/// How a simulated link is held in gravity, and how it moves.
struct SceneMotion {
  Vec3 gravity_mps2 = {0, 0, -kStandardGravity};  ///< where things fall, link frame at the swing's angle 0
  std::optional<Swing> swing;                     ///< none: it rests

  /// Gravity less the acceleration of a point of the link, m/s^2, link frame.
  Vec3 SpecificForce(double time_s, const Vec3& point_mm) const;
  /// The same, with the swing's joint moving like this.
  Vec3 SpecificForce(const JointMotion& joint, const Vec3& point_mm) const;
  /// The largest norm of it over a period, at the link's origin.
  double MostMps2() const;
};

}  // namespace taclink
