#include "server/replay/joint_replay.h"

#include <gtest/gtest.h>

#include <thread>

#include "taclink/v1/log.pb.h"
#include "tests/server/arm/arms.h"
#include "tests/server/replay/test_log.h"
#include "tests/server/support.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;

// The elbow turns by 1 mrad each 10 ms; the other joint is not of this arm.
std::shared_ptr<const mcap::Reader> MakeLog() {
  mcap::BufferSink sink;
  auto writer = wire::log::LogWriter::Create(sink, {.chunk_bytes = 1000});
  for (int i = 0; i < 200; ++i) {
    v1::JointSample sample;
    sample.add_names("nose");
    sample.add_positions(3);
    sample.add_names("elbow");
    sample.add_positions(0.001 * i);
    EXPECT_TRUE(
        (*writer)
            ->Write({.kind = wire::log::TopicKind::kJoints}, sample, {.log_utc_ns = kT0 + i * 10 * kMs})
            .ok());
  }
  EXPECT_TRUE((*writer)->mcap().Close().ok());
  return Open(sink.bytes());
}

TEST(JointReplay, PosesHaveTheStatesWhenTheyAreDue) {
  const auto kinematics = ArmKinematics::Parse("planar.urdf", kTwoJointArm);
  ASSERT_TRUE(kinematics.ok()) << kinematics.error().message;
  ArmPoses poses(*kinematics, {LinkMount{}});
  ManualClock clock;
  const auto log = MakeLog();
  const auto schedule = std::make_shared<ReplaySchedule>(kT0, kT0 + 1990 * kMs, clock);
  auto track = ReplayTrack::Open(
      log,
      {.frames = false, .events = false, .contacts = false, .arm = false, .losses = false, .joints = true},
      schedule);
  ASSERT_TRUE(track.ok()) << track.error().message;
  const JointReplay joints(std::move(*track), poses, clock);
  const int64_t begin = schedule->DueNs(0, kT0);
  clock.Advance(milliseconds(500));
  JointStateBuffer::Instant at;
  const auto give_up = std::chrono::steady_clock::now() + kForever;
  do {
    poses.joints().At(begin + 505 * kMs, at);
    std::this_thread::sleep_for(milliseconds(1));
  } while (at.validity[1] != PoseValidity::kInterpolated && std::chrono::steady_clock::now() < give_up);
  EXPECT_EQ(at.validity[1], PoseValidity::kInterpolated);
  EXPECT_NEAR(at.positions[1], 0.0505, 1e-9);
  EXPECT_EQ(at.validity[0], PoseValidity::kUnknown);
  poses.joints().At(begin + 1000 * kMs, at);
  EXPECT_EQ(at.validity[1], PoseValidity::kStale) << "not long before it is due";
}

}  // namespace
}  // namespace taclink::server
