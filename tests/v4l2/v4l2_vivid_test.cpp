// Runs as root in the machine of run-in-vm: /dev/video0 and /dev/video1 are cameras of the kernel's `vivid`
// driver.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "sensing/capture/decode.h"
#include "sensing/capture/frame_pairer.h"
#include "sensing/capture/v4l2_device.h"
#include "sensing/capture/v4l2_source.h"

namespace taclink {
namespace {

using std::chrono::milliseconds;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr const char* kTopPath = "/dev/video0";
constexpr const char* kBottomPath = "/dev/video1";
constexpr milliseconds kLongEnough{20'000};
constexpr double kRateHz = 10;
constexpr double kIntervalNs = 1e9 / kRateHz;
/// As FramePairer takes them.
constexpr double kMaxOffsetNs = (0.5 + FramePairer::kHysteresisFrames) * kIntervalNs;

// Vivid's own controls; their numbers are in the kernel's vivid-ctrls.c.
constexpr uint32_t kTimestampSource = 0x00f0f018;
constexpr uint32_t kWrapSequence = 0x00f0f026;
constexpr uint32_t kWrapTimestamp = 0x00f0f027;
constexpr uint32_t kPercentDropped = 0x00f0f040;
constexpr uint32_t kDisconnect = 0x00f0f041;
constexpr uint32_t kInjectBufferError = 0x00f0f042;
constexpr uint32_t kInjectFatalError = 0x00f0f046;

/// Through an opening of its own, as another program would.
void SetVivid(const char* path, uint32_t id, int value) {
  const int fd = open(path, O_RDWR | O_CLOEXEC);
  ASSERT_GE(fd, 0) << path;
  v4l2_control control{id, value};
  EXPECT_EQ(ioctl(fd, VIDIOC_S_CTRL, &control), 0) << path << " control " << std::hex << id;
  close(fd);
}

V4l2Options SmallCameras(double rate_hz = kRateHz) {
  V4l2Options options;
  options.devices = {kTopPath, kBottomPath};
  options.width_px = 320;
  options.height_px = 180;
  options.frame_rate_hz = rate_hz;
  return options;
}

V4l2DeviceOptions SmallCamera(const std::string& path = kTopPath) {
  V4l2DeviceOptions options;
  options.path = path;
  options.width_px = 320;
  options.height_px = 180;
  options.frame_rate_hz = kRateHz;
  return options;
}

Error OpenError(const V4l2DeviceOptions& options) {
  const auto device = V4l2Device::Open(options);
  return device ? Error{ErrorCode::kInternal, "it opened"} : device.error();
}

class Vivid : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const char* path : {kTopPath, kBottomPath}) {
      SetVivid(path, kTimestampSource, 1);  // the start of exposure, not when the picture was drawn at last
      SetVivid(path, kWrapSequence, 0);
      SetVivid(path, kWrapTimestamp, 0);
      SetVivid(path, kPercentDropped, 0);
    }
  }
};

TEST_F(Vivid, GivesPairsInOrder) {
  const auto source = MakeV4l2Source(SmallCameras(), SystemClock());
  const auto started = source->Start();
  ASSERT_TRUE(started) << started.error().message;
  EXPECT_EQ(source->Info().description, "v4l2 /dev/video0 + /dev/video1, 320x180 YUYV 10/s");
  StereoFrame frame;
  FrameTimes before;
  uint64_t first = 0, last = 0;
  for (int i = 0; i < 30; ++i) {
    const auto got = source->Next(frame, kLongEnough);
    ASSERT_TRUE(got) << got.error().message;
    for (const RawImage& image : frame.images) {
      EXPECT_TRUE(image.valid);
      EXPECT_EQ(image.bytes.size(), 320u * 180u * 2u);
      EXPECT_EQ(image.width_px, 320);
      EXPECT_EQ(image.height_px, 180);
    }
    EXPECT_LT(frame.times.exposure_monotonic_ns, frame.times.received_ns);
    EXPECT_GT(frame.times.exposure_utc_ns, int64_t{1'600'000'000} * 1'000'000'000);
    if (i == 0) {
      first = frame.sequence;
    } else {
      EXPECT_GT(frame.times.exposure_monotonic_ns, before.exposure_monotonic_ns);
      EXPECT_GT(frame.times.exposure_utc_ns, before.exposure_utc_ns);
      EXPECT_GT(frame.sequence, last);
    }
    before = frame.times;
    last = frame.sequence;
  }
  std::printf("30 pairs over %llu exposures\n", static_cast<unsigned long long>(last - first + 1));
}

TEST_F(Vivid, PairsAreOfOneMoment) {
  auto top = V4l2Device::Open(SmallCamera(kTopPath));
  auto bottom = V4l2Device::Open(SmallCamera(kBottomPath));
  ASSERT_TRUE(top && bottom);
  std::array<V4l2Device, 2> cameras{std::move(*top), std::move(*bottom)};
  for (V4l2Device& camera : cameras) ASSERT_TRUE(camera.StartStreaming());
  FramePairer pairer(kRateHz);
  double largest_ns = 0;
  for (int pairs = 0; pairs < 30;) {
    std::array<pollfd, 2> fds{pollfd{cameras[0].fd(), POLLIN, 0}, pollfd{cameras[1].fd(), POLLIN, 0}};
    ASSERT_GT(poll(fds.data(), 2, static_cast<int>(kLongEnough.count())), 0);
    for (const CameraId id : kBothCameras) {
      const auto picture = cameras[Index(id)].Dequeue();
      ASSERT_TRUE(picture) << picture.error().message;
      if (!*picture) continue;
      const auto pair = pairer.Add(id, {(*picture)->sequence, (*picture)->timestamp_ns, (*picture)->buffer});
      ASSERT_TRUE(cameras[Index(id)].Requeue((*picture)->buffer));
      if (!pair) continue;
      ++pairs;
      const auto offset = (*pair)[CameraId::kBottom].timestamp_ns - (*pair)[CameraId::kTop].timestamp_ns;
      largest_ns = std::max(largest_ns, static_cast<double>(std::abs(offset)));
    }
  }
  EXPECT_LE(largest_ns, kMaxOffsetNs);
  std::printf("largest offset %.1f ms, frame %.1f ms, unpaired %llu + %llu\n", largest_ns * 1e-6,
              pairer.frame_interval_ns() * 1e-6,
              static_cast<unsigned long long>(pairer.dropped_total(CameraId::kTop)),
              static_cast<unsigned long long>(pairer.dropped_total(CameraId::kBottom)));
}

TEST_F(Vivid, PictureIsTheTestPattern) {
  const auto source = MakeV4l2Source(SmallCameras(), SystemClock());
  ASSERT_TRUE(source->Start());
  StereoFrame frame;
  ASSERT_TRUE(source->Next(frame, kLongEnough));
  GrayDecoder decoder;
  for (const RawImage& image : frame.images) {
    cv::Mat gray;
    ASSERT_TRUE(decoder.Decode(image, gray));
    // Eight colour bars: bright at the left, dark at the right.
    const int y = gray.rows * 3 / 4;
    const int left = gray.at<uint8_t>(y, 8), right = gray.at<uint8_t>(y, gray.cols - 8);
    EXPECT_GT(left, right + 80);
  }
}

TEST_F(Vivid, ALateCallerGetsAFreshPair) {
  const auto source = MakeV4l2Source(SmallCameras(), SystemClock());
  ASSERT_TRUE(source->Start());
  StereoFrame frame;
  ASSERT_TRUE(source->Next(frame, kLongEnough));
  const uint64_t before = frame.sequence;
  const int64_t back_ns = SystemClock().MonotonicNs() + int64_t{1'000'000'000};
  SystemClock().SleepUntilMonotonicNs(back_ns);  // a caller that is busy for ten frames
  ASSERT_TRUE(source->Next(frame, kLongEnough));
  EXPECT_GT(frame.sequence, before + 5);
  EXPECT_GT(frame.times.exposure_monotonic_ns, back_ns - static_cast<int64_t>(2 * kIntervalNs));
  EXPECT_GE(source->Counters().skipped_pairs, 1u);
}

TEST_F(Vivid, TimeoutIsHonouredAndTellsWhatIsMissing) {
  const auto source = MakeV4l2Source(SmallCameras(1), SystemClock());
  ASSERT_TRUE(source->Start());
  StereoFrame frame;
  ASSERT_TRUE(source->Next(frame, kLongEnough));
  const auto got = source->Next(frame, milliseconds(1));
  ASSERT_FALSE(got);
  EXPECT_EQ(got.error().code, ErrorCode::kTimeout);
  EXPECT_THAT(got.error().message, HasSubstr("within 1 ms; nothing from /dev/video0 and /dev/video1"));
  EXPECT_TRUE(source->Next(frame, kLongEnough));
}

TEST_F(Vivid, ControlsAreSetAndReadBack) {
  V4l2DeviceOptions options = SmallCamera();
  options.settings.gain = 77;
  auto camera = V4l2Device::Open(options);
  ASSERT_TRUE(camera) << camera.error().message;
  EXPECT_EQ(camera->GetControl(V4L2_CID_GAIN, "gain").value(), 77);
  EXPECT_EQ(camera->GetControl(V4L2_CID_AUTOGAIN, "automatic gain").value(), 0);
  EXPECT_TRUE(camera->SetControl(V4L2_CID_BRIGHTNESS, "brightness", 31));
  EXPECT_EQ(camera->GetControl(V4L2_CID_BRIGHTNESS, "brightness").value(), 31);
  EXPECT_TRUE(camera->SetControl(V4L2_CID_BRIGHTNESS, "brightness", 128));
}

TEST_F(Vivid, ControlsThatItLacksOrCanNotDoAreNamed) {
  V4l2DeviceOptions options = SmallCamera();
  options.settings.exposure_100us = 50;
  EXPECT_EQ(OpenError(options).code, ErrorCode::kUnsupported);
  EXPECT_THAT(OpenError(options).message, AllOf(HasSubstr(kTopPath), HasSubstr("no control for exposure")));
  options = SmallCamera();
  options.settings.gain = 300;
  EXPECT_EQ(OpenError(options).code, ErrorCode::kInvalidArgument);
  EXPECT_THAT(OpenError(options).message, HasSubstr("gain must be from 0 to 255, not 300"));
}

TEST_F(Vivid, WrongDevicesAreNamed) {
  V4l2Options options = SmallCameras();
  options.devices = {"/dev/video6", "/dev/video7"};
  const auto started = MakeV4l2Source(options, SystemClock())->Start();
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(started.error().message,
              AllOf(HasSubstr("top camera /dev/video6"), HasSubstr("plugged in"),
                    HasSubstr("bottom camera /dev/video7"), HasSubstr("There are /dev/video0 'vivid-000")));
  for (const char* path : {"/etc/passwd", "/dev/null"}) {
    EXPECT_EQ(OpenError(SmallCamera(path)).code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(OpenError(SmallCamera(path)).message, AllOf(HasSubstr(path), HasSubstr("is not a camera")));
  }
}

TEST_F(Vivid, FormatsThatItLacksAreNamedWithWhatItOffers) {
  V4l2DeviceOptions options = SmallCamera();
  options.format = PixelFormat::kMjpeg;
  EXPECT_EQ(OpenError(options).code, ErrorCode::kUnsupported);
  std::printf("%s\n", OpenError(options).message.c_str());
  EXPECT_THAT(OpenError(options).message, AllOf(HasSubstr("320x180 MJPEG"), HasSubstr("YUYV 320x180")));
  options = SmallCamera();
  options.width_px = 333;
  EXPECT_EQ(OpenError(options).code, ErrorCode::kUnsupported);
  EXPECT_THAT(OpenError(options).message, AllOf(HasSubstr("333x180 YUYV"), HasSubstr("640x360")));
  options = SmallCamera();
  options.frame_rate_hz = 17;
  EXPECT_EQ(OpenError(options).code, ErrorCode::kUnsupported);
  EXPECT_THAT(OpenError(options).message, AllOf(HasSubstr("17 frames"), HasSubstr("10, 12.5, 15, 25")));
}

TEST_F(Vivid, WithoutAFormatTheCameraChooses) {
  V4l2DeviceOptions options = SmallCamera();
  options.format = std::nullopt;
  {
    const auto camera = V4l2Device::Open(options);
    ASSERT_TRUE(camera) << camera.error().message;
    EXPECT_EQ(camera->format(), PixelFormat::kYuyv);
  }
  options.width_px = 333;
  EXPECT_THAT(OpenError(options).message,
              AllOf(HasSubstr("does not give 333x180"), HasSubstr("YUYV 320x180")));
  options = SmallCamera();
  options.format = std::nullopt;
  options.frame_rate_hz = 17;
  EXPECT_THAT(OpenError(options).message, HasSubstr("17 frames"));
}

TEST_F(Vivid, ABusyDeviceIsNamed) {
  const auto first = V4l2Device::Open(SmallCamera());
  ASSERT_TRUE(first);
  EXPECT_EQ(OpenError(SmallCamera()).code, ErrorCode::kUnavailable);
  EXPECT_THAT(OpenError(SmallCamera()).message, AllOf(HasSubstr(kTopPath), HasSubstr("another program")));
}

TEST_F(Vivid, DamagedPicturesAreCountedNotDelivered) {
  const auto source = MakeV4l2Source(SmallCameras(), SystemClock());
  ASSERT_TRUE(source->Start());
  StereoFrame frame;
  ASSERT_TRUE(source->Next(frame, kLongEnough));
  SetVivid(kBottomPath, kInjectBufferError, 1);
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(source->Next(frame, kLongEnough));
  EXPECT_EQ(source->Counters().damaged[Index(CameraId::kBottom)], 1u);
  EXPECT_EQ(source->Counters().damaged[Index(CameraId::kTop)], 0u);
}

TEST_F(Vivid, LostPicturesAreGapsInTheSequence) {
  SetVivid(kTopPath, kPercentDropped, 40);
  const auto source = MakeV4l2Source(SmallCameras(), SystemClock());
  ASSERT_TRUE(source->Start());
  StereoFrame frame;
  ASSERT_TRUE(source->Next(frame, kLongEnough));
  const StereoFrame first = frame;
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(source->Next(frame, kLongEnough));
  const double elapsed_frames =
      static_cast<double>(frame.times.exposure_monotonic_ns - first.times.exposure_monotonic_ns) /
      kIntervalNs;
  EXPECT_GT(frame.sequence - first.sequence, 20u);
  EXPECT_NEAR(static_cast<double>(frame.sequence - first.sequence), elapsed_frames, 1);
  EXPECT_GT(source->Counters().unpaired[Index(CameraId::kBottom)], 0u);
}

TEST_F(Vivid, SequenceRisesAcrossTheDriversWrap) {
  SetVivid(kTopPath, kWrapSequence, 1);  // begins 128 before the end
  constexpr double kFastHz = 50;
  const auto source = MakeV4l2Source(SmallCameras(kFastHz), SystemClock());
  ASSERT_TRUE(source->Start());
  StereoFrame frame;
  ASSERT_TRUE(source->Next(frame, kLongEnough));
  const StereoFrame first = frame;
  uint64_t last = first.sequence;
  while (last < first.sequence + 140) {
    ASSERT_TRUE(source->Next(frame, kLongEnough));
    ASSERT_GT(frame.sequence, last);
    ASSERT_LT(frame.sequence, first.sequence + 1000);
    last = frame.sequence;
  }
  const double elapsed_frames =
      1e-9 * kFastHz *
      static_cast<double>(frame.times.exposure_monotonic_ns - first.times.exposure_monotonic_ns);
  EXPECT_NEAR(static_cast<double>(last - first.sequence), elapsed_frames, 2);
}

TEST_F(Vivid, TimestampsThatWrapAreReplacedByTheTimeOfArrival) {
  for (const char* path : {kTopPath, kBottomPath}) SetVivid(path, kWrapTimestamp, 1);  // in 16 s
  const auto source = MakeV4l2Source(SmallCameras(), SystemClock());
  ASSERT_TRUE(source->Start());
  StereoFrame frame;
  ASSERT_TRUE(source->Next(frame, kLongEnough));
  const int64_t first_ns = frame.times.exposure_monotonic_ns;
  StereoFrame last = frame;
  while (frame.times.exposure_monotonic_ns - first_ns < int64_t{18'000'000'000}) {
    const auto got = source->Next(frame, kLongEnough);
    ASSERT_TRUE(got) << got.error().message;
    ASSERT_TRUE(frame.images[0].valid && frame.images[1].valid);
    ASSERT_GT(frame.times.exposure_monotonic_ns, last.times.exposure_monotonic_ns);
    ASSERT_LE(frame.times.exposure_monotonic_ns, frame.times.received_ns);
    ASSERT_GT(frame.sequence, last.sequence);
    last = frame;
  }
  EXPECT_GT(source->Counters().stamped_on_arrival[0], 150u);
}

class Loss : public Vivid, public ::testing::WithParamInterface<uint32_t> {};

TEST_P(Loss, LeavesTheOtherCameraAndIsMended) {
  const auto source = MakeV4l2Source(SmallCameras(), SystemClock());
  ASSERT_TRUE(source->Start());
  StereoFrame frame;
  ASSERT_TRUE(source->Next(frame, kLongEnough));
  // Takes frames, none of which lacks the top camera, until then; how long it took.
  const auto until = [&](const auto& then) {
    const int64_t before_ns = SystemClock().MonotonicNs();
    for (int i = 0; i < 100; ++i) {
      const uint64_t last = frame.sequence;
      const auto got = source->Next(frame, kLongEnough);
      EXPECT_TRUE(got) << got.error().message;
      if (!got) break;
      EXPECT_TRUE(frame.images[Index(CameraId::kTop)].valid);
      EXPECT_GT(frame.sequence, last);
      if (then()) return 1e-9 * static_cast<double>(SystemClock().MonotonicNs() - before_ns);
    }
    return 1e9;
  };
  const uint64_t changes = source->Counters().info_changes;
  SetVivid(kBottomPath, GetParam(), 1);
  const double to_notice_s = until([&] { return source->Counters().info_changes > changes; });
  // Vivid plugs itself in again when its last user has gone.
  const double to_mend_s = until([&] { return frame.images[Index(CameraId::kBottom)].valid; });
  std::printf("noticed after %.2f s, mended after %.2f s\n", to_notice_s, to_mend_s);
  EXPECT_LE(to_notice_s, 1);
  EXPECT_LE(to_mend_s, 2);
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(source->Next(frame, kLongEnough));
    EXPECT_TRUE(frame.images[0].valid && frame.images[1].valid);
  }
}

INSTANTIATE_TEST_SUITE_P(Vivid, Loss, ::testing::Values(kDisconnect, kInjectFatalError),
                         [](const auto& loss) {
                           return loss.param == kDisconnect ? "Unplugged" : "FatalError";
                         });

}  // namespace
}  // namespace taclink
