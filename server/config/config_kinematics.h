#pragma once

#include <optional>
#include <string>

#include "server/config/joint_state_options.h"

namespace taclink {
class YamlMap;
}

namespace taclink::server {

/// What `arm` says of its joints.
struct KinematicsConfig {
  std::optional<std::string> urdf;  ///< path; none: links stand still
  std::string base;                 ///< link of the URDF; empty: its root
  JointStateOptions joint_states;
};

/// Reads 'urdf', 'base' and 'joint_states' of the mapping 'arm'. Relative paths are relative to `folder`.
KinematicsConfig ReadKinematics(YamlMap& arm, const std::string& folder);
/// Lines of the mapping 'arm' that read back to the same.
std::string KinematicsText(const KinematicsConfig& config);

}  // namespace taclink::server
