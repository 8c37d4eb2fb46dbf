// A robot's description: what is accepted can be used.
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "server/arm/arm_kinematics.h"

using taclink::server::ArmKinematics;

// urdfdom's links and joints hold each other where a description has a cycle: its leak, and once a start.
extern "C" const char* __lsan_default_suppressions() {  // NOLINT(bugprone-reserved-identifier)
  return "leak:liburdfdom";
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const auto arm = ArmKinematics::Parse("arm.urdf", std::string(reinterpret_cast<const char*>(data), size));
  if (!arm.ok()) {
    if (arm.error().message.empty()) std::abort();
    return 0;
  }
  const auto base = (*arm)->FindFrame((*arm)->base());
  if (!base.ok()) std::abort();
  const std::vector<double> positions((*arm)->joints().size(), 0.1);
  const taclink::Rigid3 pose = (*arm)->BaseFromFrame(*base, positions);
  if (!pose.translation.allFinite() || !pose.rotation.allFinite()) std::abort();
  return 0;
}
