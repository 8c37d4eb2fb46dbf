#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "server/attitude/client_attitude.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

constexpr int64_t kMs = 1'000'000;

StereoFrame Applied(AttitudeSource& source, int64_t exposure_ns) {
  StereoFrame frame;
  frame.times.exposure_monotonic_ns = exposure_ns;
  source.Apply(frame);
  return frame;
}

TEST(AttitudeSource, SaysWhatIsConfigured) {
  EXPECT_FALSE(Applied(*MakeFixedAttitude(), 5).specific_force);
  const auto constant = Applied(*MakeConstantAttitude({0, -9.81, 0}, 0.5), 5).specific_force;
  ASSERT_TRUE(constant);
  EXPECT_EQ(constant->mps2, Vec3(0, -9.81, 0));
  EXPECT_EQ(constant->covariance, Mat3(0.25 * Mat3::Identity()));
  EXPECT_EQ(constant->origin, AttitudeOrigin::kConstant);
  const auto unknown = Applied(*MakeUnknownAttitude(), 5).specific_force;
  ASSERT_TRUE(unknown);
  EXPECT_EQ(unknown->origin, AttitudeOrigin::kNone);
  EXPECT_GT(unknown->covariance(0, 0), 25);
}

TEST(AttitudeSource, ASimulationKnowsItsOwn) {
  StereoFrame frame;
  frame.specific_force = SpecificForceReading{.mps2 = {1, 2, 3}, .origin = AttitudeOrigin::kSimulated};
  MakeSourceAttitude()->Apply(frame);
  EXPECT_EQ(frame.specific_force->mps2, Vec3(1, 2, 3));
  MakeFixedAttitude()->Apply(frame);
  EXPECT_FALSE(frame.specific_force);
}

TEST(AttitudeSource, OnlyClientsAreTold) {
  const auto told = MakeUnknownAttitude()->Tell({0, 0, -9.81}, 0, 5);
  ASSERT_FALSE(told.ok());
  EXPECT_EQ(told.error().code, ErrorCode::kFailedPrecondition);
  EXPECT_THAT(told.error().message, HasSubstr("gravity: {source: grpc}"));
}

class ClientAttitudeTest : public ::testing::Test {
 protected:
  ClientAttitude source_{0.2, std::chrono::milliseconds(100)};
};

TEST_F(ClientAttitudeTest, ReadingsAreInterpolatedAtTheExposure) {
  EXPECT_TRUE(source_.Tell({0, 0, -10}, 0, 100 * kMs).value());
  EXPECT_TRUE(source_.Tell({4, 0, -8}, 0.5, 140 * kMs).value());
  const auto between = Applied(source_, 110 * kMs).specific_force;
  ASSERT_TRUE(between);
  EXPECT_TRUE(between->mps2.isApprox(Vec3(1, 0, -9.5)));
  EXPECT_NEAR(between->covariance(0, 0), 0.25, 1e-12) << "the worse of the two";
  EXPECT_EQ(between->origin, AttitudeOrigin::kClient);
  const auto after = Applied(source_, 200 * kMs).specific_force;
  EXPECT_EQ(after->mps2, Vec3(4, 0, -8));
  const auto before = Applied(source_, 50 * kMs).specific_force;
  EXPECT_EQ(before->mps2, Vec3(0, 0, -10));
  EXPECT_NEAR(before->covariance(0, 0), 0.04, 1e-12) << "as configured";
}

TEST_F(ClientAttitudeTest, SilenceIsUnknown) {
  for (const int64_t told_ns : {int64_t{0}, 10 * kMs}) {
    if (told_ns > 0) source_.Tell({0, 0, -10}, 0, told_ns).value();
    const auto silent = Applied(source_, 111 * kMs).specific_force;
    ASSERT_TRUE(silent);
    EXPECT_GT(silent->covariance(0, 0), 25);
    EXPECT_THAT(silent->trouble, HasSubstr("within 0.10 s"));
  }
  EXPECT_TRUE(Applied(source_, 110 * kMs).specific_force->trouble.empty());
}

TEST_F(ClientAttitudeTest, OldAndImpossibleReadingsAreNotTaken) {
  EXPECT_TRUE(source_.Tell({0, 0, -10}, 0, 100 * kMs).value());
  EXPECT_FALSE(source_.Tell({0, 0, 10}, 0, 100 * kMs).value());
  EXPECT_FALSE(source_.Tell({0, 0, 10}, 0, 50 * kMs).value());
  EXPECT_EQ(Applied(source_, 100 * kMs).specific_force->mps2, Vec3(0, 0, -10));
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const Vec3& impossible : {Vec3(0, 101, 0), Vec3(kNan, 0, 0), Vec3(0, 0, -kNan)})
    EXPECT_EQ(source_.Tell(impossible, 0, 200 * kMs).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(source_.Tell({0, 0, 0}, -1, 200 * kMs).error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace taclink::server
