#pragma once

#include <kdl/tree.hpp>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "server/arm/arm_kinematics.h"

// Internal to this folder: it shows KDL's types.

namespace taclink::server {

/// A joint of KDL's tree follows `joint`: KDL's position = factor * position + offset. KDL's are rad and mm.
struct JointRule {
  size_t joint = 0;  ///< in UrdfTree::joints
  double factor = 1, offset = 0;
};

/// What a URDF says, lengths in mm.
struct UrdfTree {
  KDL::Tree tree;
  std::string root;
  std::vector<std::string> frames;  ///< from the root to the tips
  std::vector<ArmVisual> visuals;
  std::vector<JointInfo> joints;           ///< that move by themselves, likewise
  std::map<std::string, JointRule> rules;  ///< by the name of each joint that moves
  std::set<std::string> dependent;         ///< fixed and mimicking joints
};

/// Errors: kInvalidArgument with `name` and what is wrong.
Result<UrdfTree> ReadUrdf(const std::string& name, const std::string& xml);

}  // namespace taclink::server
