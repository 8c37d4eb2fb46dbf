#include "sensing/capture/v4l2_camera.h"

#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <functional>
#include <future>
#include <memory>
#include <utility>

#include "sensing/capture/camera_finder.h"
#include "sensing/capture/v4l2_device.h"

namespace taclink {
namespace {

/// A picture's time is not in the future, nor has a driver kept it for so long.
constexpr int64_t kMaxAheadNs = 100'000'000, kMaxAgeNs = 60'000'000'000;

class V4l2Camera final : public CameraDevice {
 public:
  V4l2Camera(V4l2Device device, std::string description, const V4l2Options& options, Clock& clock)
      : device_(std::move(device)),
        description_(std::move(description)),
        width_px_(options.width_px),
        height_px_(options.height_px),
        clock_(clock) {}

  Result<std::optional<DriverPicture>> Dequeue() override;
  Result<void> Requeue(int buffer) override { return device_.Requeue(buffer); }
  Result<void> Set(const CameraSettings& settings) override { return device_.Set(settings); }
  CameraSettings settings() const override { return device_.settings(); }
  CameraFormat format() const override {
    return {device_.format(), width_px_, height_px_, device_.bytes_per_line()};
  }
  std::string description() const override { return description_; }
  int buffer_count() const override { return device_.buffer_count(); }
  uint64_t damaged() const override { return device_.damaged(); }
  uint64_t stamped_on_arrival() const override { return stamped_on_arrival_; }
  int fd() const { return device_.fd(); }

 private:
  V4l2Device device_;
  const std::string description_;
  const int width_px_, height_px_;
  Clock& clock_;
  uint64_t stamped_on_arrival_ = 0;
};

Result<std::optional<DriverPicture>> V4l2Camera::Dequeue() {
  auto picture = device_.Dequeue();
  if (!picture || !*picture) return picture;
  int64_t& stamp_ns = (*picture)->timestamp_ns;
  const int64_t now_ns = clock_.MonotonicNs();
  if (stamp_ns > now_ns + kMaxAheadNs || stamp_ns < now_ns - kMaxAgeNs) {
    stamp_ns = now_ns;
    ++stamped_on_arrival_;
  }
  return picture;
}

/// Where the node belongs, so that it can be found again.
std::string DescribeNode(const std::string& node) {
  for (const FoundCamera& camera : ListCameras()) {
    if (camera.node != node || camera.usb_path.empty()) continue;
    return node + " (usb:" + camera.usb_path +
           (camera.serial.empty() ? std::string() : ", serial:" + camera.serial) + ")";
  }
  return node;
}

OpenedCamera OpenStreaming(const V4l2DeviceOptions& asked, const V4l2Options& options, Clock& clock) {
  auto device = V4l2Device::Open(asked);
  if (!device) return device.error();
  if (auto streaming = device->StartStreaming(); !streaming) return streaming.error();
  return std::unique_ptr<CameraDevice>(
      std::make_unique<V4l2Camera>(std::move(*device), DescribeNode(asked.path), options, clock));
}

OpenedCamera OpenByName(const V4l2Options& options, CameraId id, const CameraSettings& settings, Clock& clock,
                        std::function<bool()> is_wanted) {
  const std::string& name = options.devices[Index(id)];
  const auto node = FindCamera(name);
  if (!node) return node.error();
  V4l2DeviceOptions asked{.path = *node,
                          .width_px = options.width_px,
                          .height_px = options.height_px,
                          .frame_rate_hz = options.frame_rate_hz,
                          .format = options.format,
                          .settings = settings,
                          .buffers = options.buffers,
                          .is_wanted = std::move(is_wanted)};
  auto camera = OpenStreaming(asked, options, clock);
  if (!camera && camera.error().code == ErrorCode::kResourceExhausted && !options.format) {
    asked.format = PixelFormat::kMjpeg;  // a full bus may have room for compressed pictures
    auto compressed = OpenStreaming(asked, options, clock);
    if (compressed) return compressed;
  }
  if (!camera && *node != name) return Error{camera.error().code, name + ": " + camera.error().message};
  return camera;
}

class V4l2CameraSystem final : public CameraSystem {
 public:
  V4l2CameraSystem(V4l2Options options, Clock& clock) : options_(std::move(options)), clock_(clock) {
    settings_.fill({.exposure_100us = options_.exposure_100us, .gain = options_.gain});
  }

  std::future<OpenedCamera> Open(CameraId id, std::unique_ptr<CameraDevice> old) override {
    // The thread shares nothing with this object, which may go while a camera hangs.
    return OpenDetached(std::move(old), [options = options_, id, settings = settings_[Index(id)],
                                         &clock = clock_, owner = std::weak_ptr<const void>(owner_)] {
      return OpenByName(options, id, settings, clock, [owner] { return !owner.expired(); });
    });
  }
  void Remember(CameraId id, const CameraSettings& settings) override { settings_[Index(id)].Take(settings); }

  std::array<std::string, kCameraCount> Wait(const CameraDevices& devices, int64_t until_ns) override;

 private:
  const V4l2Options options_;
  Clock& clock_;
  std::array<CameraSettings, kCameraCount> settings_;
  const std::shared_ptr<const void> owner_ =
      std::make_shared<int>();  // while this lives, it wants its cameras
};

std::array<std::string, kCameraCount> V4l2CameraSystem::Wait(const CameraDevices& devices, int64_t until_ns) {
  std::array<pollfd, kCameraCount> fds{};
  std::array<std::string, kCameraCount> trouble;
  for (size_t i = 0; i < kCameraCount; ++i) {
    const auto* const camera = static_cast<const V4l2Camera*>(devices[i]);  // Open made it
    fds[i] = {camera ? camera->fd() : -1, POLLIN, 0};
  }
  const int64_t left_ns = std::max<int64_t>(0, until_ns - clock_.MonotonicNs());
  const timespec left{left_ns / 1'000'000'000, left_ns % 1'000'000'000};
  const bool failed = ppoll(fds.data(), fds.size(), &left, nullptr) < 0 && errno != EINTR;
  for (size_t i = 0; i < kCameraCount; ++i) {
    if (!devices[i]) continue;
    if (failed) {
      trouble[i] = std::string("can't be waited for: ") + std::strerror(errno);
    } else if (fds[i].revents & (POLLERR | POLLHUP | POLLNVAL)) {
      trouble[i] = "lost; was it unplugged?";
    }
  }
  return trouble;
}

}  // namespace

std::unique_ptr<CameraSystem> MakeV4l2CameraSystem(V4l2Options options, Clock& clock) {
  return std::make_unique<V4l2CameraSystem>(std::move(options), clock);
}

}  // namespace taclink
