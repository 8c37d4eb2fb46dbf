#include "server/config/config_kinematics.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>

#include "sensing/yaml/yaml_reader.h"
#include "server/config/config_names.h"

namespace taclink::server {
namespace {

constexpr Range kStaleS{.min = 0.001, .max = 60};

double Seconds(std::chrono::milliseconds duration) {
  return std::chrono::duration<double>(duration).count();
}
std::chrono::milliseconds FromSeconds(double seconds) {
  return std::chrono::milliseconds(std::llround(seconds * 1e3));
}

}  // namespace

KinematicsConfig ReadKinematics(YamlMap& arm, const std::string& folder) {
  KinematicsConfig config;
  if (arm.Has("urdf")) {
    const std::string path = arm.Text("urdf");
    if (path.empty()) arm.Fail("urdf", "must be the path of a file");
    config.urdf = (std::filesystem::path(folder) / path).lexically_normal().string();
  }
  config.base = arm.Text("base", "");
  if (!config.base.empty() && !config.urdf) arm.Fail("base", "is a link of a URDF; give 'urdf' too");
  if (arm.Has("joint_states") && !config.urdf)
    arm.Fail("joint_states", "are of a URDF's joints; give 'urdf' too");
  YamlMap states = arm.Map("joint_states");
  JointStateOptions& options = config.joint_states;
  options.stale_after = FromSeconds(states.Number("stale_after_s", Seconds(options.stale_after), kStaleS));
  const double stale_s = Seconds(options.stale_after);
  options.extrapolate = FromSeconds(states.Number(
      "extrapolate_s", std::min(Seconds(options.extrapolate), stale_s), {.min = 0, .max = stale_s}));
  states.Done();
  return config;
}

std::string KinematicsText(const KinematicsConfig& config) {
  std::ostringstream out;
  if (!config.urdf) return {};
  out << "  urdf: " << Quoted(*config.urdf) << "\n";
  if (!config.base.empty()) out << "  base: " << Quoted(config.base) << "\n";
  out << "  joint_states: {stale_after_s: " << Seconds(config.joint_states.stale_after)
      << ", extrapolate_s: " << Seconds(config.joint_states.extrapolate) << "}\n";
  return out.str();
}

}  // namespace taclink::server
