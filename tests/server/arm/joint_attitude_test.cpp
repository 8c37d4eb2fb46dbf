// Against the closed form of a link that turns about a horizontal axis.
#include "server/arm/joint_attitude.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

// Turns about y; the link stands 0.4 m out along the arm's x.
constexpr const char* kPendulum = R"(<robot name="pendulum">
  <link name="world"/> <link name="arm"/>
  <joint name="swing" type="revolute">
    <parent link="world"/> <child link="arm"/> <axis xyz="0 1 0"/> <limit lower="-3" upper="3" effort="1" velocity="1"/>
  </joint>
</robot>)";
constexpr double kRadiusM = 0.4, kGravity = 9.80665;
constexpr int64_t kStateNs = 10'000'000;

class JointAttitudeTest : public ::testing::Test {
 protected:
  JointAttitudeTest() {
    options_.center_mm = {0, 0, 0};
    options_.length_mm = 200;
    attitude_ = MakeJointAttitude(poses_, 0, options_);
  }
  static std::vector<LinkMount> Mounts(const ArmKinematics& kinematics) {
    return {{.frame = kinematics.FindFrame("arm").value(),
             .frame_from_link = {Mat3::Identity(), Vec3(1e3 * kRadiusM, 0, 0)}}};
  }
  // angle(t) for joint states until a time, each 10 ms.
  template <typename Angle>
  void Move(int64_t until_ns, Angle angle) {
    for (int64_t time_ns = 0; time_ns <= until_ns; time_ns += kStateNs) {
      const std::array<size_t, 1> joint = {0};
      const std::array<double, 1> position = {angle(1e-9 * static_cast<double>(time_ns))};
      ASSERT_TRUE(poses_.joints()
                      .Add({.time_ns = time_ns, .joints = joint, .positions = position, .velocities = {}})
                      .ok());
    }
  }
  SpecificForceReading At(int64_t time_ns) {
    StereoFrame frame;
    frame.times.exposure_monotonic_ns = time_ns;
    attitude_->Apply(frame);
    return frame.specific_force.value();
  }
  static double Sigma(const SpecificForceReading& reading) { return std::sqrt(reading.covariance(0, 0)); }

  const std::shared_ptr<const ArmKinematics> kinematics_ =
      ArmKinematics::Parse("pendulum", kPendulum).value();
  ArmPoses poses_{kinematics_, Mounts(*kinematics_)};
  JointAttitudeOptions options_;
  std::unique_ptr<AttitudeSource> attitude_;
};

TEST_F(JointAttitudeTest, AtRestItIsGravityInTheLinksFrame) {
  Move(1'000'000'000, [](double) { return 0.5; });
  const SpecificForceReading reading = At(1'000'000'000);
  EXPECT_EQ(reading.origin, AttitudeOrigin::kJointStates);
  // About y by 0.5: the base's -z is (sin, 0, -cos) in the link's frame.
  EXPECT_TRUE(reading.mps2.isApprox(kGravity * Vec3(std::sin(0.5), 0, -std::cos(0.5)), 1e-6))
      << reading.mps2.transpose();
  EXPECT_NEAR(Sigma(reading), 0.2, 1e-6);
}

TEST_F(JointAttitudeTest, AccelerationIsTakenOff) {
  constexpr double kAmplitude = 1, kOmega = 2;
  Move(5'000'000'000, [](double s) { return kAmplitude * std::sin(kOmega * s); });
  for (const int64_t time_ns : {int64_t{3'000'000'000}, int64_t{3'640'000'000}, int64_t{4'725'000'000}}) {
    const double s = 1e-9 * static_cast<double>(time_ns);
    const double angle = kAmplitude * std::sin(kOmega * s),
                 speed = kAmplitude * kOmega * std::cos(kOmega * s), acceleration = -kOmega * kOmega * angle;
    // In the link's frame the pivot lies along -x: centripetal along -x, tangential along -z for a rotation
    // about y that rises.
    const Vec3 inertial(-kRadiusM * speed * speed, 0, -kRadiusM * acceleration);
    const Vec3 truth = kGravity * Vec3(std::sin(angle), 0, -std::cos(angle)) - inertial;
    const SpecificForceReading reading = At(time_ns);
    EXPECT_LT((reading.mps2 - truth).norm(), 2 * Sigma(reading)) << s;
    EXPECT_LT((reading.mps2 - truth).norm(), 0.4) << s;
    EXPECT_GT(Sigma(reading), 0.2) << s;
  }
}

TEST_F(JointAttitudeTest, PositionsThatAreHeldAreNoSuddenStop) {
  Move(2'000'000'000, [](double s) { return 0.5 * s; });
  const SpecificForceReading newest = At(2'000'000'000), later = At(2'015'000'000);
  EXPECT_LT((later.mps2 - newest.mps2).norm(), 0.05);
  EXPECT_GT(Sigma(later), Sigma(newest));
}

TEST_F(JointAttitudeTest, WithoutCurrentJointStatesItIsUnknown) {
  EXPECT_THAT(At(0).trouble, HasSubstr("missing"));
  EXPECT_GT(Sigma(At(0)), 5);
  Move(100'000'000, [](double) { return 0.0; });
  EXPECT_TRUE(At(100'000'000).trouble.empty());
  EXPECT_THAT(At(1'000'000'000).trouble, HasSubstr("stale"));
  EXPECT_GT(Sigma(At(1'000'000'000)), 5);
}

}  // namespace
}  // namespace taclink::server
