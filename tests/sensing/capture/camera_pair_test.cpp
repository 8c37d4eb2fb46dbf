#include "sensing/capture/camera_pair.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>

#include "tests/sensing/capture/fake_cameras.h"
#include "tests/support/times.h"

namespace taclink {
namespace {

using std::chrono::milliseconds;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr size_t kTop = Index(CameraId::kTop), kBottom = Index(CameraId::kBottom);

class CameraPairTest : public ::testing::Test {
 protected:
  CameraPairTest() { cameras_[kBottom].offset_ns = 2 * kMs; }

  void Start() {
    const auto started = source_->Start();
    ASSERT_TRUE(started) << started.error().message;
  }
  Result<void> Next() { return source_->Next(frame_, milliseconds(100)); }
  int64_t Now() const { return clock_.MonotonicNs(); }

  /// Takes frames until `done` says so of one; the time that passed, and no frame was late.
  template <typename Done>
  std::optional<milliseconds> Until(Done done, double longest_s = 10) {
    const int64_t before_ns = Now();
    while (Now() - before_ns < static_cast<int64_t>(1e9 * longest_s)) {
      if (Next() && done(frame_)) return milliseconds((Now() - before_ns) / kMs);
    }
    return std::nullopt;
  }
  static bool IsPair(const StereoFrame& frame) { return frame.images[0].valid && frame.images[1].valid; }
  static bool IsTopAlone(const StereoFrame& frame) { return frame.images[0].valid && !frame.images[1].valid; }

  WaitedClock clock_;
  std::array<FakeCamera, kCameraCount> cameras_;
  std::unique_ptr<FrameSource> source_ =
      MakeCameraPair({.names = {"usb:1", "usb:2"}, .width_px = 640, .height_px = 480, .frame_rate_hz = 100},
                     std::make_unique<FakeCameraSystem>(clock_, cameras_), clock_);
  StereoFrame frame_;
};

TEST_F(CameraPairTest, GivesPairsOfOneMomentAndEveryBufferBack) {
  Start();
  uint64_t last = 0;
  for (int i = 0; i < 50; ++i) {
    ASSERT_TRUE(Next());
    ASSERT_TRUE(IsPair(frame_));
    EXPECT_EQ(frame_.images[kTop].bytes, std::vector<uint8_t>{0});
    EXPECT_EQ(frame_.images[kBottom].bytes, std::vector<uint8_t>{1});
    if (i > 0) {
      EXPECT_EQ(frame_.sequence, last + 1);
    }
    last = frame_.sequence;
    EXPECT_LE(cameras_[kTop].buffers_out + cameras_[kBottom].buffers_out, 1);
  }
  const SourceCounters counters = source_->Counters();
  EXPECT_NEAR(counters.rate_hz[kTop], 100, 1e-6);
  EXPECT_EQ(counters.pictures[kBottom], 50u);
  EXPECT_EQ(counters.lost[kTop], 0u);
  EXPECT_EQ(source_->Info().description, "v4l2 usb:1 + usb:2, 640x480 MJPEG 100/s");
}

TEST_F(CameraPairTest, AnUnpluggedCameraIsDoneWithoutAtOnceAndTakenBack) {
  Start();
  ASSERT_TRUE(Next());
  const uint64_t before = frame_.sequence;
  cameras_[kBottom].plugged = false;
  const auto noticed = Until(IsTopAlone);
  ASSERT_TRUE(noticed);
  EXPECT_LE(noticed->count(), 30);
  EXPECT_THAT(frame_.images[kBottom].why_missing, HasSubstr("fake: is not plugged in"));
  EXPECT_LE(frame_.sequence, before + 4);
  // Every picture of the other one is a frame.
  for (int i = 0; i < 300; ++i) {
    const uint64_t last = frame_.sequence;
    ASSERT_TRUE(Next());
    ASSERT_TRUE(IsTopAlone(frame_));
    ASSERT_EQ(frame_.sequence, last + 1);
  }
  EXPECT_EQ(source_->Counters().rate_hz[kBottom], 0);
  EXPECT_THAT(source_->Info().cameras[kBottom].trouble, HasSubstr("not plugged in"));
  EXPECT_EQ(source_->Info().cameras[kTop].trouble, "");

  cameras_[kBottom].plugged = true;
  const auto back = Until(IsPair);
  ASSERT_TRUE(back);
  EXPECT_LE(back->count(), 400);
  EXPECT_EQ(source_->Info().cameras[kBottom].trouble, "");
  const uint64_t last = frame_.sequence;
  ASSERT_TRUE(Next());
  EXPECT_TRUE(IsPair(frame_));
  EXPECT_EQ(frame_.sequence, last + 1);
  EXPECT_LE(cameras_[kTop].buffers_out + cameras_[kBottom].buffers_out, 2);
}

TEST_F(CameraPairTest, TheTopCameraMayBeTheLostOne) {
  Start();
  ASSERT_TRUE(Next());
  const auto is_bottom_alone = [](const StereoFrame& frame) {
    return !frame.images[kTop].valid && frame.images[kBottom].valid;
  };
  cameras_[kTop].plugged = false;
  ASSERT_TRUE(Until(is_bottom_alone));
  for (int i = 0; i < 20; ++i) {
    const uint64_t last = frame_.sequence;
    ASSERT_TRUE(Next());
    ASSERT_TRUE(is_bottom_alone(frame_));
    EXPECT_EQ(frame_.sequence, last + 1);
  }
  cameras_[kTop].plugged = true;
  cameras_[kTop].first_sequence = 5000;  // it counts again
  const uint64_t last = frame_.sequence;
  const int64_t last_ns = frame_.times.exposure_monotonic_ns;
  ASSERT_TRUE(Until(IsPair));
  EXPECT_EQ(static_cast<int64_t>(frame_.sequence - last),
            (frame_.times.exposure_monotonic_ns - last_ns + 5 * kMs) / (10 * kMs));
}

TEST_F(CameraPairTest, ASilentCameraIsDoneWithoutAndOpenedAnew) {
  Start();
  ASSERT_TRUE(Next());
  const int opened = cameras_[kBottom].opened;
  cameras_[kBottom].silent = true;
  const auto noticed = Until(IsTopAlone);
  ASSERT_TRUE(noticed);
  EXPECT_LE(noticed->count(), 320);
  EXPECT_THAT(frame_.images[kBottom].why_missing, HasSubstr("usb:2: gives no pictures"));
  ASSERT_TRUE(Until([&](const StereoFrame&) { return cameras_[kBottom].opened > opened; }, 2));
  EXPECT_EQ(cameras_[kBottom].open_devices, 1);
  cameras_[kBottom].silent = false;
  const auto back = Until(IsPair);
  ASSERT_TRUE(back);
  EXPECT_LE(back->count(), 50);
}

TEST_F(CameraPairTest, AHiccupNeedsNoReopening) {
  Start();
  ASSERT_TRUE(Next());
  cameras_[kTop].silent = true;
  ASSERT_TRUE(Until([](const StereoFrame& frame) { return !frame.images[kTop].valid; }));
  cameras_[kTop].silent = false;
  ASSERT_TRUE(Until(IsPair));
  EXPECT_EQ(cameras_[kTop].opened, 1);
  EXPECT_GT(source_->Counters().lost[kTop], 25u);
}

TEST_F(CameraPairTest, OneCameraIsEnoughToStart) {
  cameras_[kTop].open_error = "usb:1: busy; another program uses this camera";
  Start();
  ASSERT_TRUE(Next());
  EXPECT_FALSE(frame_.images[kTop].valid);
  EXPECT_THAT(frame_.images[kTop].why_missing, HasSubstr("another program"));
  EXPECT_TRUE(frame_.images[kBottom].valid);
  cameras_[kTop].open_error.clear();
  const auto back = Until(IsPair);
  ASSERT_TRUE(back);
  EXPECT_LE(back->count(), 400);
}

TEST_F(CameraPairTest, ACameraThatDoesNotAnswerHoldsNobodyUp) {
  cameras_[kBottom].answers = false;
  const int64_t before_ns = Now();
  Start();
  EXPECT_LE(Now() - before_ns, 1100 * kMs);
  for (int i = 0; i < 100; ++i) {
    const uint64_t last = frame_.sequence;
    ASSERT_TRUE(Next());
    ASSERT_TRUE(IsTopAlone(frame_));
    if (i > 1) {
      EXPECT_EQ(frame_.sequence, last + 1);
    }
  }
  EXPECT_EQ(cameras_[kBottom].opened, 0) << "one attempt at a time";
  cameras_[kBottom].answers = true;
  EXPECT_TRUE(Until(IsPair, 0.1));
}

TEST_F(CameraPairTest, BothLostIsUnavailableAndNamesBoth) {
  Start();
  ASSERT_TRUE(Next());
  const uint64_t before = frame_.sequence;
  for (FakeCamera& camera : cameras_) camera.plugged = false;
  Result<void> got = Next();
  for (int i = 0; i < 10 && got; ++i) got = Next();
  ASSERT_FALSE(got);
  EXPECT_EQ(got.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(got.error().message, AllOf(HasSubstr("top camera"), HasSubstr("bottom camera")));
  const auto failed = source_->Start();
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(failed.error().message, HasSubstr("is not plugged in"));
  for (FakeCamera& camera : cameras_) camera.plugged = true;
  Start();
  ASSERT_TRUE(Next());
  EXPECT_TRUE(IsPair(frame_));
  EXPECT_GT(frame_.sequence, before);
  EXPECT_EQ(cameras_[kTop].open_devices, 1);
}

TEST_F(CameraPairTest, PicturesThatNeverMatchAreNoPairsAndTheReasonSaysSo) {
  // One camera's clock is off by more than half a frame of the pair's; its pictures come far apart.
  cameras_[kTop].interval_ns = cameras_[kBottom].interval_ns = 50 * kMs;
  cameras_[kTop].skipped = {};
  for (uint32_t n = 0; n < 100; ++n) cameras_[n % 2 == 0 ? kTop : kBottom].skipped.insert(n);
  Start();
  const auto got = source_->Next(frame_, milliseconds(1000));
  ASSERT_FALSE(got);
  EXPECT_EQ(got.error().code, ErrorCode::kTimeout);
  EXPECT_THAT(got.error().message, HasSubstr("more than half a frame"));
  EXPECT_GT(source_->Counters().unpaired[kTop], 5u);
}

TEST_F(CameraPairTest, ExposuresThatTheDriverLostAreCounted) {
  cameras_[kBottom].skipped = {5, 6, 9};
  Start();
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(Next());
  const SourceCounters counters = source_->Counters();
  EXPECT_EQ(counters.lost[kBottom], 3u);
  EXPECT_EQ(counters.lost[kTop], 0u);
  EXPECT_EQ(counters.unpaired[kTop], 3u);
}

TEST_F(CameraPairTest, ALateCallerGetsTheNewestPair) {
  Start();
  ASSERT_TRUE(Next());
  clock_.SleepUntilMonotonicNs(Now() + 1000 * kMs);
  ASSERT_TRUE(Next());
  EXPECT_GT(frame_.times.exposure_monotonic_ns, Now() - 20 * kMs);
  EXPECT_TRUE(IsPair(frame_)) << "its pictures waited; it was not silent";
  EXPECT_GE(source_->Counters().skipped_pairs, 1u);
}

TEST_F(CameraPairTest, SettingsGoToTheCameraAndAreKeptForItsReturn) {
  Start();
  ASSERT_TRUE(Next());
  const uint64_t changes = source_->Counters().info_changes;
  EXPECT_TRUE(source_->SetCamera(CameraId::kBottom, {.exposure_100us = 80}).ok());
  EXPECT_TRUE(cameras_[kTop].set.empty());
  ASSERT_EQ(cameras_[kBottom].set.size(), 1u);
  EXPECT_EQ(cameras_[kBottom].set[0].exposure_100us, 80);
  EXPECT_EQ(cameras_[kBottom].kept.size(), 1u);
  EXPECT_EQ(source_->Info().cameras[kBottom].settings.exposure_100us, 80);
  EXPECT_GT(source_->Counters().info_changes, changes);

  cameras_[kBottom].set_error = "gain must be from 0 to 64";
  const auto refused = source_->SetCamera(CameraId::kBottom, {.gain = 900});
  EXPECT_EQ(refused.error().message, "gain must be from 0 to 64");
  EXPECT_EQ(cameras_[kBottom].kept.size(), 1u) << "what was refused is not tried again";

  cameras_[kBottom].plugged = false;
  ASSERT_TRUE(Until(IsTopAlone));
  const auto gone = source_->SetCamera(CameraId::kBottom, {.gain = 2});
  EXPECT_EQ(gone.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(gone.error().message, HasSubstr("usb:2"));
}

TEST_F(CameraPairTest, InfoChangesAreCounted) {
  Start();
  ASSERT_TRUE(Next());
  const uint64_t before = source_->Counters().info_changes;
  ASSERT_TRUE(Next());
  EXPECT_EQ(source_->Counters().info_changes, before);
  cameras_[kTop].plugged = false;
  ASSERT_TRUE(Until([](const StereoFrame& frame) { return !frame.images[kTop].valid; }));
  EXPECT_GT(source_->Counters().info_changes, before);
}

}  // namespace
}  // namespace taclink
