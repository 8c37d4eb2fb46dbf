#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sensing/core/geometry.h"

namespace taclink {

/// A rigid body, or one piece of it, that presses on a simulated skin. Link frame.
struct AppliedContact {
  uint64_t body_id = 0;           ///< chosen by the user who presses it; 0: the scene's
  Vec3 center_mm = Vec3::Zero();  ///< of pressure, on the deformed outer surface
  Vec3 normal = Vec3::Zero();     ///< unit, of the deformed skin there, away from the axis
  Vec3 force_n = Vec3::Zero();    ///< what it exerts on the skin
  double depth_mm = 0;            ///< of its foremost point, along the normal from the undeformed surface
};

/// What is true of a simulated link at a frame's exposure. Nothing is estimated from it.
struct SimulationReport {
  std::vector<AppliedContact> contacts;
  std::string trouble;  ///< why a user's bodies do not go on, or were taken off; empty: nothing
};

}  // namespace taclink
