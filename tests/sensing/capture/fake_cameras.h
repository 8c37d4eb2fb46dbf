#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <future>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "sensing/capture/camera_device.h"
#include "sensing/core/clock.h"

namespace taclink {

/// Time that passes only while someone waits.
class WaitedClock final : public Clock {
 public:
  int64_t MonotonicNs() const override { return now_ns_; }
  int64_t UtcNs() const override { return now_ns_ + 1'700'000'000'000'000'000; }
  void SleepUntilMonotonicNs(int64_t time_ns) override { now_ns_ = std::max(now_ns_, time_ns); }

 private:
  int64_t now_ns_ = 1'000'000'000;
};

/// What a test does to one camera. Its pictures are of the times start + n * interval.
struct FakeCamera {
  bool plugged = true;
  bool silent = false;     ///< streams, but gives nothing
  bool answers = true;     ///< false: opening it takes until it answers
  std::string open_error;  ///< empty: opens
  int64_t interval_ns = 10'000'000;
  int64_t offset_ns = 0;
  uint32_t first_sequence = 0;
  std::set<uint32_t> skipped = {};  ///< exposures that the driver never hands out
  int opened = 0;
  std::string set_error = {};             ///< empty: takes any setting
  std::vector<CameraSettings> set = {};   ///< by Set
  std::vector<CameraSettings> kept = {};  ///< by Remember: for the next opening

  int open_devices = 0;
  int buffers_out = 0;  ///< pictures that were taken and not given back
};

/// Two cameras without any hardware. A picture's bytes are its camera's number.
class FakeCameraSystem final : public CameraSystem {
 public:
  static constexpr int kBuffers = 4;

  FakeCameraSystem(WaitedClock& clock, std::array<FakeCamera, kCameraCount>& cameras)
      : clock_(clock), cameras_(cameras) {}

  std::future<OpenedCamera> Open(CameraId id, std::unique_ptr<CameraDevice> old) override {
    old.reset();
    Attempt& attempt = attempts_[Index(id)].emplace_back();
    auto future = attempt.result.get_future();
    Answer(id);
    return future;
  }

  void Remember(CameraId id, const CameraSettings& settings) override {
    cameras_[Index(id)].kept.push_back(settings);
  }

  std::array<std::string, kCameraCount> Wait(const CameraDevices& devices, int64_t until_ns) override {
    int64_t next_ns = until_ns;
    std::array<std::string, kCameraCount> trouble;
    for (const CameraId id : kBothCameras) {
      const auto* const device = static_cast<const Device*>(devices[Index(id)]);
      if (!device) continue;
      if (!cameras_[Index(id)].plugged) {
        trouble[Index(id)] = "lost; was it unplugged?";
        next_ns = clock_.MonotonicNs();
      } else if (!cameras_[Index(id)].silent) {
        next_ns = std::min(next_ns, device->next_ns());
      }
    }
    clock_.SleepUntilMonotonicNs(next_ns);
    for (const CameraId id : kBothCameras) Answer(id);
    return trouble;
  }

 private:
  struct Attempt {
    std::promise<OpenedCamera> result;
  };

  class Device final : public CameraDevice {
   public:
    Device(WaitedClock& clock, FakeCamera& camera, CameraId id)
        : clock_(clock), camera_(camera), bytes_{static_cast<uint8_t>(Index(id))} {
      ++camera_.open_devices;
      start_ns_ = (clock_.MonotonicNs() / camera_.interval_ns + 1) * camera_.interval_ns + camera_.offset_ns;
    }
    ~Device() override {
      --camera_.open_devices;
      camera_.buffers_out -= static_cast<int>(out_.size());
    }

    int64_t next_ns() const { return start_ns_ + taken_ * camera_.interval_ns; }

    Result<std::optional<DriverPicture>> Dequeue() override {
      if (!camera_.plugged) return Error{ErrorCode::kUnavailable, "fake: no such device"};
      while (next_ns() <= clock_.MonotonicNs()) {
        const auto sequence = camera_.first_sequence + static_cast<uint32_t>(taken_);
        const int64_t stamp_ns = next_ns();
        ++taken_;
        if (camera_.silent || camera_.skipped.contains(sequence)) continue;
        int buffer = 0;
        while (out_.contains(buffer)) ++buffer;
        if (buffer == kBuffers) continue;  // no room: the driver drops it
        out_.insert(buffer);
        ++camera_.buffers_out;
        return std::optional(DriverPicture{bytes_, sequence, stamp_ns, buffer});
      }
      return std::optional<DriverPicture>();
    }
    Result<void> Requeue(int buffer) override {
      if (out_.erase(buffer) == 1) --camera_.buffers_out;
      if (!camera_.plugged) return Error{ErrorCode::kUnavailable, "fake: no such device"};
      return {};
    }

    CameraFormat format() const override { return {PixelFormat::kMjpeg, 640, 480, 0}; }
    Result<void> Set(const CameraSettings& settings) override {
      if (!camera_.set_error.empty()) return Error{ErrorCode::kInvalidArgument, camera_.set_error};
      camera_.set.push_back(settings);
      return {};
    }
    CameraSettings settings() const override {
      return camera_.set.empty() ? CameraSettings() : camera_.set.back();
    }
    std::string description() const override { return "fake"; }
    int buffer_count() const override { return kBuffers; }
    uint64_t damaged() const override { return 0; }
    uint64_t stamped_on_arrival() const override { return 0; }

   private:
    WaitedClock& clock_;
    FakeCamera& camera_;
    const std::array<uint8_t, 1> bytes_;
    int64_t start_ns_ = 0;
    int64_t taken_ = 0;
    std::set<int> out_;
  };

  /// Ends the attempts to open a camera that answers.
  void Answer(CameraId id) {
    FakeCamera& camera = cameras_[Index(id)];
    if (!camera.answers) return;
    for (Attempt& attempt : attempts_[Index(id)]) {
      ++camera.opened;
      if (!camera.plugged) {
        attempt.result.set_value(Error{ErrorCode::kUnavailable, "fake: is not plugged in"});
      } else if (!camera.open_error.empty()) {
        attempt.result.set_value(Error{ErrorCode::kUnavailable, camera.open_error});
      } else {
        attempt.result.set_value(std::unique_ptr<CameraDevice>(std::make_unique<Device>(clock_, camera, id)));
      }
    }
    attempts_[Index(id)].clear();
  }

  WaitedClock& clock_;
  std::array<FakeCamera, kCameraCount>& cameras_;
  std::array<std::deque<Attempt>, kCameraCount> attempts_;
};

}  // namespace taclink
