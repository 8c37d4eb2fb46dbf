#include "server/arm/simulated_joints.h"

#include <algorithm>
#include <utility>

namespace taclink::server {
namespace {

class SimulatedJoints final : public AttitudeSource {
 public:
  SimulatedJoints(ArmPoses& poses, std::unique_ptr<AttitudeSource> attitude)
      : poses_(poses), attitude_(std::move(attitude)) {}

  void Apply(StereoFrame& frame) override {
    if (frame.joint) Pass(*frame.joint, frame.times.exposure_monotonic_ns);
    attitude_->Apply(frame);
  }
  Result<bool> Tell(const Vec3& mps2, double sigma_mps2, int64_t time_ns) override {
    return attitude_->Tell(mps2, sigma_mps2, time_ns);
  }

 private:
  void Pass(const SimulatedJoint& joint, int64_t time_ns) {
    const auto& joints = poses_.joints().joints();
    const auto found = std::ranges::find(joints, joint.name, &JointInfo::name);
    if (found == joints.end()) return;
    const auto index = static_cast<size_t>(found - joints.begin());
    // Refused where the joint has a newer state already.
    static_cast<void>(poses_.joints().Add({.time_ns = time_ns,
                                           .joints = {&index, 1},
                                           .positions = {&joint.position_rad, 1},
                                           .velocities = {&joint.velocity_radps, 1}}));
  }

  ArmPoses& poses_;
  const std::unique_ptr<AttitudeSource> attitude_;
};

}  // namespace

std::unique_ptr<AttitudeSource> PassSimulatedJoints(ArmPoses& poses,
                                                    std::unique_ptr<AttitudeSource> attitude) {
  return std::make_unique<SimulatedJoints>(poses, std::move(attitude));
}

}  // namespace taclink::server
