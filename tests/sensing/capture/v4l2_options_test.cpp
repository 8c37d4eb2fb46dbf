// What can be said without a camera; the rest is in tests/v4l2.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sensing/capture/v4l2_device.h"
#include "sensing/capture/v4l2_source.h"
#include "tests/sensing/capture/pictures.h"

namespace taclink {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

Error StartError(const V4l2Options& options) {
  const auto started = MakeV4l2Source(options, SystemClock())->Start();
  return started ? Error{ErrorCode::kInternal, "it started"} : started.error();
}

TEST(V4l2Options, MissingCamerasMayComeLater) {
  const V4l2Options options{.devices = {"/dev/no-such-camera-1", "/dev/no-such-camera-2"}};
  EXPECT_EQ(StartError(options).code, ErrorCode::kUnavailable);
  EXPECT_THAT(StartError(options).message,
              AllOf(HasSubstr("top camera /dev/no-such-camera-1"), HasSubstr("plugged in")));
}

TEST(V4l2Options, WhatIsNoCameraIsSaid) {
  const TemporaryFolder folder;
  WriteBytes(folder / "file", {1});
  for (const std::string& path : {folder / "file", folder.path(), std::string("/dev/null")}) {
    const V4l2Options options{.devices = {path, "/dev/video1"}};
    EXPECT_EQ(StartError(options).code, ErrorCode::kInvalidArgument);
    EXPECT_THAT(StartError(options).message, AllOf(HasSubstr(path), HasSubstr("not a camera")));
  }
}

// /dev/null stands for a camera that answered too late: that it is none would be the next step's finding.
TEST(V4l2Options, ACameraThatNobodyWaitsForAnyMoreIsNotTouched) {
  int asked = 0;
  V4l2DeviceOptions options{.path = "/dev/null"};
  options.is_wanted = [&asked] { return ++asked > 1; };
  EXPECT_THAT(V4l2Device::Open(options).error().message, HasSubstr("nobody waited"));
  EXPECT_THAT(V4l2Device::Open(options).error().message, HasSubstr("not a camera"));
}

TEST(V4l2Options, ImpossibleOptionsAreNamed) {
  const V4l2Options good{.devices = {"/dev/video0", "/dev/video1"}};
  const auto message = [&good](auto change) {
    V4l2Options options = good;
    change(options);
    EXPECT_EQ(StartError(options).code, ErrorCode::kInvalidArgument);
    return StartError(options).message;
  };
  EXPECT_THAT(message([](V4l2Options& o) { o.devices[1] = o.devices[0]; }), HasSubstr("must be two devices"));
  EXPECT_THAT(message([](V4l2Options& o) { o.devices[0] = ""; }), HasSubstr("names no camera"));
  EXPECT_THAT(message([](V4l2Options& o) { o.buffers = 3; }), HasSubstr("at least 4 buffers"));
  EXPECT_THAT(message([](V4l2Options& o) { o.buffers = 33; }), HasSubstr("buffers"));
  EXPECT_THAT(message([](V4l2Options& o) { o.width_px = 0; }), HasSubstr("size 0x480"));
  EXPECT_THAT(message([](V4l2Options& o) { o.frame_rate_hz = 0; }), HasSubstr("frame rate"));
}

TEST(V4l2Options, NextBeforeStartAsksForStart) {
  StereoFrame frame;
  const auto source = MakeV4l2Source({.devices = {"/dev/video0", "/dev/video1"}}, SystemClock());
  const auto got = source->Next(frame, std::chrono::milliseconds(1));
  ASSERT_FALSE(got);
  EXPECT_EQ(got.error().code, ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace taclink
