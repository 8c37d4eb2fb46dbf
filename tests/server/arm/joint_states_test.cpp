#include "server/arm/joint_states.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <thread>

#include "server/arm/joint_state_intake.h"
#include "tests/server/arm/arms.h"
#include "tests/server/support.h"
#include "tests/support/times.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

JointStateBuffer MakeBuffer() {
  return JointStateBuffer({{.name = "a", .kind = JointKind::kRevolute, .limits = JointLimits{-2, 2}},
                           {.name = "b", .kind = JointKind::kContinuous, .limits = {}},
                           {.name = "c", .kind = JointKind::kPrismatic, .limits = JointLimits{0.1, 0.5}}});
}

Result<size_t> Add(JointStateBuffer& buffer, int64_t time_ns, std::vector<size_t> joints,
                   std::vector<double> positions, std::vector<double> velocities = {}) {
  return buffer.Add({.time_ns = time_ns, .joints = joints, .positions = positions, .velocities = velocities});
}

struct JointAt {
  double position;
  PoseValidity validity;
  int64_t distance_ns;
};
JointAt At(const JointStateBuffer& buffer, size_t joint, int64_t time_ns) {
  JointStateBuffer::Instant instant;
  buffer.At(time_ns, instant);
  return {instant.positions[joint], instant.validity[joint], instant.distance_ns[joint]};
}

TEST(JointStates, StraightBetweenPositions) {
  auto buffer = MakeBuffer();
  for (int i = 0; i < 10; ++i) EXPECT_TRUE(Add(buffer, (100 + 10 * i) * kMs, {0}, {0.1 * i}).ok());
  for (int i = 0; i <= 90; ++i) {
    const auto at = At(buffer, 0, (100 + i) * kMs);
    EXPECT_NEAR(at.position, 0.01 * i, 1e-12);
    EXPECT_EQ(at.validity, PoseValidity::kInterpolated);
    EXPECT_EQ(at.distance_ns, std::min(i % 10, 10 - i % 10) * kMs);
  }
}

TEST(JointStates, ThoseAfterATimeComeInOrder) {
  auto buffer = MakeBuffer();
  for (int i = 1; i <= 3; ++i) EXPECT_TRUE(Add(buffer, i * kMs, {1}, {0.1 * i}, {1.0 * i}).ok());
  const auto after = buffer.After(1, kMs);
  ASSERT_EQ(after.size(), 2u);
  EXPECT_EQ(after[0].time_ns, 2 * kMs);
  EXPECT_EQ(after[1].position, 0.1 * 3);
  EXPECT_EQ(after[1].velocity, 3.0);
  EXPECT_TRUE(buffer.After(1, 3 * kMs).empty());
  EXPECT_TRUE(buffer.After(0, 0).empty());
}

// A cubic is exact for a joint that moves by one.
TEST(JointStates, VelocitiesMakeACubic) {
  auto buffer = MakeBuffer();
  const auto position = [](double t) { return 0.3 + 2 * t - 5 * t * t + 7 * t * t * t; };
  const auto velocity = [](double t) { return 2 - 10 * t + 21 * t * t; };
  for (const double t : {0.1, 0.2, 0.3})
    EXPECT_TRUE(Add(buffer, std::llround(t * 1e9), {0}, {position(t)}, {velocity(t)}).ok());
  for (double t = 0.1; t < 0.3; t += 0.0125)
    EXPECT_NEAR(At(buffer, 0, std::llround(t * 1e9)).position, position(t), 1e-9);
}

TEST(JointStates, AContinuousJointTakesTheShortWayRound) {
  auto buffer = MakeBuffer();
  EXPECT_TRUE(Add(buffer, 100 * kMs, {1}, {3.1}).ok());
  EXPECT_TRUE(Add(buffer, 110 * kMs, {1}, {-3.1}).ok());
  EXPECT_NEAR(At(buffer, 1, 105 * kMs).position, kPi, 1e-12);
}

TEST(JointStates, BeyondTheNewestMotionGoesOnAndThenIsStale) {
  auto buffer = MakeBuffer();
  EXPECT_TRUE(Add(buffer, 1000 * kMs, {0, 1}, {0.5, 0.25}, {2, 0}).ok());
  auto at = At(buffer, 0, 1020 * kMs);
  EXPECT_NEAR(at.position, 0.54, 1e-12);
  EXPECT_EQ(at.validity, PoseValidity::kExtrapolated);
  EXPECT_EQ(at.distance_ns, 20 * kMs);
  at = At(buffer, 0, 1200 * kMs);
  EXPECT_NEAR(at.position, 0.6, 1e-12) << "continued for 50 ms only";
  EXPECT_EQ(at.validity, PoseValidity::kExtrapolated);
  EXPECT_EQ(At(buffer, 0, 1201 * kMs).validity, PoseValidity::kStale);
  EXPECT_EQ(At(buffer, 0, 1000 * kMs).validity, PoseValidity::kInterpolated);
  EXPECT_EQ(At(buffer, 0, 700 * kMs).validity, PoseValidity::kStale) << "before the oldest";
  // A gap in the middle is as bad as one at the end.
  EXPECT_TRUE(Add(buffer, 2000 * kMs, {0}, {1}).ok());
  EXPECT_EQ(At(buffer, 0, 1500 * kMs).validity, PoseValidity::kStale);
  EXPECT_EQ(At(buffer, 0, 1900 * kMs).validity, PoseValidity::kInterpolated);
}

TEST(JointStates, AJointWithoutStatesIsUnknown) {
  const auto buffer = MakeBuffer();
  EXPECT_EQ(At(buffer, 0, 5).validity, PoseValidity::kUnknown);
  EXPECT_EQ(At(buffer, 0, 5).position, 0);
  EXPECT_EQ(At(buffer, 2, 5).position, 0.1) << "0 is outside its range";
  EXPECT_EQ(At(buffer, 0, 5).distance_ns, -1);
}

TEST(JointStates, OldStatesFallOutAndLateOnesAreNotTaken) {
  JointStateBuffer buffer({{.name = "a", .kind = JointKind::kContinuous, .limits = {}}}, {.capacity = 4});
  for (int i = 1; i <= 10; ++i) EXPECT_EQ(*Add(buffer, i * kMs, {0}, {1.0 * i}), 1u);
  EXPECT_EQ(*Add(buffer, 10 * kMs, {0}, {99}), 0u);
  EXPECT_EQ(*Add(buffer, 3 * kMs, {0}, {99}), 0u);
  EXPECT_NEAR(At(buffer, 0, 8 * kMs).position, 8, 1e-12);
  EXPECT_NEAR(At(buffer, 0, 2 * kMs).position, 7, 1e-12) << "7 is the oldest kept";
}

TEST(JointStates, NumbersThatCannotBeAreRefused) {
  auto buffer = MakeBuffer();
  const auto complaint = [&](std::vector<size_t> joints, std::vector<double> positions,
                             std::vector<double> velocities = {}) {
    const auto added = Add(buffer, 100, std::move(joints), std::move(positions), std::move(velocities));
    return added.ok() ? "accepted" : added.error().message;
  };
  EXPECT_THAT(complaint({0, 1}, {0.5, kNan}), HasSubstr("joint 'b': position nan"));
  EXPECT_THAT(complaint({1}, {1e300}), HasSubstr("joint 'b': position 1e+300"));
  EXPECT_THAT(complaint({0}, {0}, {HUGE_VAL}), HasSubstr("joint 'a': velocity inf"));
  EXPECT_THAT(complaint({0}, {90}), HasSubstr("far outside its range, -2 to 2 rad"));
  EXPECT_THAT(complaint({2}, {300}), HasSubstr("0.1 to 0.5 m; check unit"));
  EXPECT_EQ(complaint({0}, {2.1}), "accepted") << "a little beyond its range";
  EXPECT_EQ(At(buffer, 1, 100).validity, PoseValidity::kUnknown) << "nothing of a bad message is taken";
}

// For the thread sanitizer.
TEST(JointStates, WritersAndReadersAtATime) {
  auto buffer = MakeBuffer();
  std::vector<std::jthread> threads;
  for (size_t joint = 0; joint < 2; ++joint) {
    threads.emplace_back([&buffer, joint] {
      for (int i = 1; i <= 3000; ++i) EXPECT_TRUE(Add(buffer, i * kMs, {joint}, {i * 1e-4}).ok());
    });
    threads.emplace_back([&buffer, joint] {
      for (int i = 1; i <= 500; ++i) {
        const auto at = At(buffer, joint, 6 * i * kMs);
        EXPECT_GE(at.position, 0);
        EXPECT_LE(at.position, 0.3);
      }
    });
  }
  threads.clear();
  EXPECT_NEAR(At(buffer, 1, 3000 * kMs).position, 0.3, 1e-12);
}

class JointIntake : public ::testing::Test {
 protected:
  std::string Take(const JointMessage& message) {
    const auto taken = intake_.Take(message);
    return taken.ok() ? "accepted" : taken.error().message;
  }
  int64_t Now() const { return clock_.MonotonicNs(); }

  ManualClock clock_;
  ArmPoses poses_{*ArmKinematics::Parse("arm.urdf", kThreeJointArm), {}};
  JointStateIntake intake_{poses_, clock_};
};

TEST_F(JointIntake, NamesStandInTheFirstMessage) {
  EXPECT_EQ(Take({{"twist", "pitch"}, {0.1, 0.2}, {}, 0, Now()}), "accepted");
  clock_.Advance(std::chrono::milliseconds(10));
  EXPECT_EQ(Take({{}, {0.3, 0.4}, {1, 2}, clock_.UtcNs(), 0}), "accepted");
  EXPECT_NEAR(At(poses_.joints(), 2, Now()).position, 0.3, 1e-12);
  EXPECT_NEAR(At(poses_.joints(), 0, Now()).position, 0.4, 1e-12);
  EXPECT_NEAR(At(poses_.joints(), 0, Now() - 5 * kMs).position, 0.3, 1e-12) << "UTC and monotonic agree";
  EXPECT_EQ(At(poses_.joints(), 1, Now()).validity, PoseValidity::kUnknown);
  EXPECT_EQ(intake_.counts().accepted, 2u);
}

TEST_F(JointIntake, JointsThatFollowOthersMayBeNamed) {
  EXPECT_EQ(Take({{"grip", "lift"}, {77, 0.2}, {}, 0, Now()}), "accepted");
  EXPECT_NEAR(At(poses_.joints(), 1, Now()).position, 0.2, 1e-12);
}

TEST_F(JointIntake, BadMessagesSayWhy) {
  EXPECT_THAT(Take({{}, {0.1}, {}, 0, Now()}), HasSubstr("the first message must name"));
  EXPECT_THAT(Take({{"elbow"}, {0.1}, {}, 0, Now()}),
              HasSubstr("no joint 'elbow'; there are: pitch, lift, twist"));
  EXPECT_THAT(Take({{"pitch", "pitch"}, {0.1, 0.1}, {}, 0, Now()}), HasSubstr("named twice"));
  EXPECT_THAT(Take({{"pitch"}, {0.1, 0.2}, {}, 0, Now()}), HasSubstr("2 positions for 1 joints"));
  EXPECT_THAT(Take({{"pitch"}, {0.1}, {1, 2}, 0, Now()}), HasSubstr("2 velocities for 1 joints"));
  EXPECT_THAT(Take({{"pitch"}, {0.1}, {}, 0, 0}), HasSubstr("no time"));
  EXPECT_THAT(Take({{"pitch"}, {0.1}, {}, 0, -5}), HasSubstr("no time"));
  EXPECT_THAT(Take({{"pitch"}, {kNan}, {}, 0, Now()}), HasSubstr("position nan"));
  EXPECT_THAT(Take({{"pitch"}, {0.1}, {}, 0, Now() + 3'000 * kMs}), HasSubstr("3.000 s ahead"));
  EXPECT_THAT(Take({{"pitch"}, {0.1}, {}, 0, Now() + 21 * kMs}), HasSubstr("0.021 s ahead"));
  EXPECT_THAT(Take({{"pitch"}, {0.1}, {}, clock_.UtcNs() - 20'000 * kMs, 0}), HasSubstr("20.000 s behind"));
  EXPECT_THAT(Take({{"pitch"}, {0.1}, {}, std::numeric_limits<int64_t>::max(), 0}), HasSubstr("ahead"));
  EXPECT_EQ(intake_.counts().accepted, 0u);
  EXPECT_EQ(Take({{"pitch"}, {0.1}, {}, 0, Now()}), "accepted");
  EXPECT_THAT(
      Take({{}, {0.2}, {}, 0, Now() - 7 * kMs}),
      ::testing::AllOf(HasSubstr("message 2 of this call"),
                       HasSubstr("0.007 s before that of the message before"), HasSubstr("1 before it")));
}

TEST_F(JointIntake, UselessMessagesAreCounted) {
  JointStateIntake other(poses_, clock_);
  clock_.Advance(std::chrono::seconds(1));
  EXPECT_EQ(Take({{"pitch"}, {0.1}, {}, 0, Now()}), "accepted");
  EXPECT_EQ(Take({{}, {0.2}, {}, 0, Now()}), "accepted");
  EXPECT_EQ(intake_.counts().refused, 1u);
  EXPECT_THAT(intake_.counts().first_refusal, HasSubstr("again"));
  EXPECT_TRUE(other.Take({{"pitch"}, {0.5}, {}, 0, Now() - 5 * kMs}).ok());
  EXPECT_EQ(other.counts().accepted, 0u);
  EXPECT_THAT(other.counts().first_refusal, HasSubstr("another client"));
  EXPECT_TRUE(other.Take({{"pitch", "lift"}, {0.5, 0.3}, {}, 0, Now()}).ok());
  EXPECT_EQ(other.counts().accepted, 1u) << "lift is news";
  EXPECT_NEAR(At(poses_.joints(), 0, Now()).position, 0.1, 1e-12);
}

TEST(JointIntakeWithoutUrdf, IsRefused) {
  ManualClock clock;
  ArmPoses poses(std::vector<LinkMount>(1));
  const auto taken = JointStateIntake(poses, clock).Take({{"pitch"}, {0.1}, {}, 0, 1});
  ASSERT_FALSE(taken.ok());
  EXPECT_EQ(taken.error().code, ErrorCode::kFailedPrecondition);
  EXPECT_THAT(taken.error().message, HasSubstr("arm.urdf"));
}

}  // namespace
}  // namespace taclink::server
