#include "server/arm/simulated_joints.h"

#include <gtest/gtest.h>

#include "tests/server/arm/arms.h"

namespace taclink::server {
namespace {

class SimulatedJointsTest : public ::testing::Test {
 protected:
  // Shows a frame whose simulation has a joint at that position.
  StereoFrame Show(const std::string& joint, double position_rad, int64_t exposure_ns) {
    StereoFrame frame;
    frame.times.exposure_monotonic_ns = exposure_ns;
    frame.joint = SimulatedJoint{.name = joint, .position_rad = position_rad, .velocity_radps = 0.5};
    attitude_->Apply(frame);
    return frame;
  }
  double PositionAt(int64_t time_ns) {
    JointStateBuffer::Instant instant;
    poses_.joints().At(time_ns, instant);
    validity_ = instant.validity.front();
    return instant.positions.front();
  }

  std::shared_ptr<const ArmKinematics> kinematics_ =
      ArmKinematics::Parse("arm.urdf", kTwoJointArm, "").value();
  ArmPoses poses_{kinematics_, {}};
  std::unique_ptr<AttitudeSource> attitude_ =
      PassSimulatedJoints(poses_, MakeConstantAttitude({0, -9.81, 0}, 0.2));
  PoseValidity validity_ = PoseValidity::kUnknown;
};

TEST_F(SimulatedJointsTest, TheArmFollowsTheSimulation) {
  const StereoFrame frame = Show("shoulder", 0.3, 1'000'000'000);
  EXPECT_NEAR(PositionAt(1'000'000'000), 0.3, 1e-12);
  EXPECT_EQ(validity_, PoseValidity::kInterpolated);
  ASSERT_TRUE(frame.specific_force);
  EXPECT_EQ(frame.specific_force->mps2, Vec3(0, -9.81, 0));
}

TEST_F(SimulatedJointsTest, JointsThatTheUrdfLacksAreIgnored) {
  Show("knee", 0.3, 1'000'000'000);
  Show("", 0.3, 2'000'000'000);
  PositionAt(2'000'000'000);
  EXPECT_EQ(validity_, PoseValidity::kUnknown);
}

}  // namespace
}  // namespace taclink::server
