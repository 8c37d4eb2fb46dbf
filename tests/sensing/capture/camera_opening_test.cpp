// Opening cameras on detached threads, while one of them hangs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "sensing/capture/camera_pair.h"
#include "sensing/core/thread_start.h"
#include "tests/sensing/capture/fake_cameras.h"

namespace taclink {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// What happened, in its order, from any thread.
class Events {
 public:
  void Add(std::string event) {
    const std::lock_guard lock(mutex_);
    events_.push_back(std::move(event));
  }
  std::vector<std::string> all() const {
    const std::lock_guard lock(mutex_);
    return events_;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::string> events_;
};

class NotedDevice final : public CameraDevice {
 public:
  NotedDevice(std::string name, Events& events) : name_(std::move(name)), events_(events) {}
  ~NotedDevice() override { events_.Add(name_ + " closed"); }

  Result<std::optional<DriverPicture>> Dequeue() override { return std::optional<DriverPicture>(); }
  Result<void> Requeue(int) override { return {}; }
  CameraFormat format() const override { return {}; }
  std::string description() const override { return name_; }
  int buffer_count() const override { return 4; }
  uint64_t damaged() const override { return 0; }
  uint64_t stamped_on_arrival() const override { return 0; }

 private:
  const std::string name_;
  Events& events_;
};

/// Two cameras whose opening hangs until the test lets it go on.
class HangingCameras final : public CameraSystem {
 public:
  HangingCameras(WaitedClock& clock, Events& events, std::shared_future<void> go)
      : clock_(clock), events_(events), go_(std::move(go)) {}

  std::future<OpenedCamera> Open(CameraId id, std::unique_ptr<CameraDevice> old) override {
    return OpenDetached(std::move(old), [&events = events_, id, go = go_]() -> OpenedCamera {
      go.wait();
      return std::unique_ptr<CameraDevice>(std::make_unique<NotedDevice>(Name(id), events));
    });
  }
  std::array<std::string, kCameraCount> Wait(const CameraDevices&, int64_t until_ns) override {
    clock_.SleepUntilMonotonicNs(until_ns);
    return {};
  }

 private:
  WaitedClock& clock_;
  Events& events_;
  const std::shared_future<void> go_;
};

class CameraOpeningTest : public ::testing::Test {
 protected:
  ~CameraOpeningTest() override {
    while (DetachedThreads() > 0) std::this_thread::yield();
  }

  std::unique_ptr<FrameSource> MakePair() {
    return MakeCameraPair(
        {.names = {"usb:1", "usb:2"}, .width_px = 640, .height_px = 480, .frame_rate_hz = 100},
        std::make_unique<HangingCameras>(clock_, events_, go_.get_future().share()), clock_);
  }

  WaitedClock clock_;
  Events events_;
  std::promise<void> go_;
};

// With a future of std::async the destructor waits here until the cameras answer, which they never do.
TEST_F(CameraOpeningTest, DestroyingASourceDoesNotWaitForACameraThatHangs) {
  auto pair = MakePair();
  EXPECT_EQ(pair->Start().error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(DetachedThreads(), 2);
  pair.reset();
  events_.Add("source destroyed");
  EXPECT_EQ(DetachedThreads(), 2) << "they still hang";
  go_.set_value();
  while (DetachedThreads() > 0) std::this_thread::yield();
  const auto all = events_.all();
  ASSERT_EQ(all.size(), 3u) << "what came too late is closed by the threads that opened it";
  EXPECT_EQ(all[0], "source destroyed");
  EXPECT_THAT(all[1], HasSubstr("closed"));
  EXPECT_THAT(all[2], HasSubstr("closed"));
}

TEST_F(CameraOpeningTest, TheOldDeviceIsClosedBeforeTheNewOneOpens) {
  auto opening = OpenDetached(std::make_unique<NotedDevice>("old", events_), [this]() -> OpenedCamera {
    events_.Add("opened");
    return Error{ErrorCode::kUnavailable, "busy"};
  });
  EXPECT_EQ(opening.get().error().message, "busy");
  EXPECT_THAT(events_.all(), ElementsAre("old closed", "opened"));
}

TEST_F(CameraOpeningTest, WithoutAThreadTheCameraIsLostWithThatReasonAndTriedAgain) {
  go_.set_value();
  auto pair = MakePair();
  {
    const ThreadShortage shortage("camera-open");
    const auto started = pair->Start();
    ASSERT_FALSE(started.ok());
    EXPECT_EQ(started.error().code, ErrorCode::kResourceExhausted);
    EXPECT_THAT(started.error().message, HasSubstr("no thread can be started for camera-open"));
    EXPECT_EQ(shortage.refused(), 2);
  }
  Result<void> started;
  do {  // the clock of the cameras passes faster than their threads get there
    started = pair->Start();
  } while (!started);
  EXPECT_EQ(pair->Info().cameras.size(), 2u);
}

}  // namespace
}  // namespace taclink
