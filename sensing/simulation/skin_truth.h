#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/simulation/scene_motion.h"

namespace taclink {

/// Radius of the deformed inner wall over the undeformed angle and z: what can hide a marker.
struct RadiusGrid {
  int columns = 0;  ///< around the axis, closed; column c at first_angle_rad + c 2 pi / columns
  double first_angle_rad = 0;
  std::vector<double> z_mm;             ///< by row, rising
  std::vector<double> radius_mm;        ///< row * columns + column
  std::vector<double> row_min_mm;       ///< the least radius of each row
  double largest_inward_change_mm = 0;  ///< against the undeformed wall
};

/// One thing that pushes on the skin. Link frame.
struct TrueContact {
  int index = 0;                  ///< in the scene's list, from 0; of a user's body behind those, by part
  uint64_t body_id = 0;           ///< of a body that a user presses; 0: the scene's
  Vec3 center_mm = Vec3::Zero();  ///< on the deformed outer surface
  Vec3 normal = Vec3::Zero();     ///< unit, of the deformed skin there, away from the axis
  Vec3 force_n = Vec3::Zero();    ///< what the world exerts on the skin
  double depth_mm = 0;  ///< of the centre, along the normal from the undeformed surface; inward is positive
  double patch_diameter_mm = 0;
  bool limited = false;  ///< pushed less than the scene asks: the skin would go inside the tube
};

/// Everything that is true about a simulated skin at one moment.
struct SkinTruth {
  uint64_t frame = 0;  ///< time_s in frames of the scene
  double time_s = 0;   ///< since the scene's start, not wrapped
  double pressure_mpa = 0;
  Vec3 specific_force_mps2 = Vec3::Zero();  ///< link frame; zero: a skin without weight
  JointMotion joint;                        ///< of the scene's swing, if it has one
  std::string trouble;               ///< why a user's bodies do not go on or were taken off; empty: nothing
  std::vector<Vec3> marker_mm;       ///< centres (see MarkerGrid::center_depth_mm), by marker index
  std::vector<Vec3> marker_wall_mm;  ///< feet of the domes on the inner wall
  std::vector<Vec3> marker_normal;   ///< of the skin there, unit, away from the axis
  std::vector<bool> marker_is_lost;  ///< broken off the skin; empty: none is
  RadiusGrid inner_wall;
  std::vector<TrueContact> contacts;  ///< those that push now
  Vec3 total_force_n = Vec3::Zero();  ///< their sum
};

}  // namespace taclink
