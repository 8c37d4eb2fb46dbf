#include "sensing/capture/v4l2_source.h"

#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "sensing/capture/frame_pairer.h"
#include "sensing/capture/v4l2_device.h"
#include "sensing/capture/v4l2_offers.h"

namespace taclink {
namespace {

/// Waiting pictures, the newest pair, and one for the driver to fill.
constexpr int kMinBuffers = static_cast<int>(FramePairer::kDepth) + 2;

class V4l2Source final : public FrameSource {
 public:
  V4l2Source(V4l2Options options, Clock& clock)
      : options_(std::move(options)), clock_(clock), pairer_(std::max(options_.frame_rate_hz, 1e-3)) {}

  Result<void> Start() override;
  Result<void> Next(StereoFrame& frame, std::chrono::milliseconds timeout) override;
  SourceInfo Info() const override;
  SourceCounters Counters() const override;

 private:
  struct Camera {
    std::optional<V4l2Device> device;
    std::vector<std::span<const uint8_t>> bytes;  ///< of the buffers that are not with the driver
    uint64_t pictures = 0;                        ///< since Start or the last pair delivered
    uint64_t damaged_before = 0;                  ///< on devices closed since
  };

  Result<V4l2Device> OpenCamera(CameraId id) const;
  Result<void> Drain();
  Result<bool> DrainOne(CameraId id);
  Result<void> GiveBack(CameraId id, const PictureTag& picture);
  Result<void> SkipPair();
  bool IsStale() const;
  Result<void> Wait(int64_t until_ns);
  Result<void> Deliver(StereoFrame& frame);
  void Copy(CameraId id, const PictureTag& picture, RawImage& image) const;
  Error NothingYet(std::chrono::milliseconds timeout) const;
  void Close();

  const V4l2Options options_;
  Clock& clock_;
  FramePairer pairer_;
  std::array<Camera, kCameraCount> cameras_;
  std::optional<FramePair> newest_;  ///< found, not delivered yet
  uint64_t skipped_pairs_ = 0;
};

Result<void> V4l2Source::Start() {
  Close();
  if (options_.buffers < kMinBuffers) {
    return Error{ErrorCode::kInvalidArgument,
                 "cameras need at least " + std::to_string(kMinBuffers) + " buffers"};
  }
  if (options_.devices[0] == options_.devices[1]) {
    return Error{ErrorCode::kInvalidArgument,
                 "both cameras of the link are '" + options_.devices[0] + "'; they must be two devices"};
  }
  for (const CameraId id : kBothCameras) {
    Camera& camera = cameras_[Index(id)];
    auto device = OpenCamera(id);
    if (!device) {
      Close();
      return Error{device.error().code, std::string(Name(id)) + " camera " + device.error().message};
    }
    camera.device.emplace(std::move(*device));
    camera.bytes.assign(static_cast<size_t>(camera.device->buffer_count()), {});
    camera.pictures = 0;
  }
  for (const CameraId id : kBothCameras) {
    if (auto streaming = cameras_[Index(id)].device->StartStreaming(); !streaming) {
      Close();
      return Error{streaming.error().code, std::string(Name(id)) + " camera " + streaming.error().message};
    }
  }
  return {};
}

Result<V4l2Device> V4l2Source::OpenCamera(CameraId id) const {
  V4l2DeviceOptions device;
  device.path = options_.devices[Index(id)];
  device.width_px = options_.width_px;
  device.height_px = options_.height_px;
  device.frame_rate_hz = options_.frame_rate_hz;
  device.format = options_.format;
  device.exposure_100us = options_.exposure_100us;
  device.gain = options_.gain;
  device.buffers = options_.buffers;
  return V4l2Device::Open(device);
}

void V4l2Source::Close() {
  for (Camera& camera : cameras_) {
    if (camera.device) camera.damaged_before += camera.device->damaged();
    camera.device.reset();
  }
  newest_.reset();
  pairer_.Restart();
}

Result<void> V4l2Source::Next(StereoFrame& frame, std::chrono::milliseconds timeout) {
  if (!cameras_[0].device) return Error{ErrorCode::kUnavailable, "the cameras are not open: start them"};
  const int64_t until_ns = clock_.MonotonicNs() + std::chrono::nanoseconds(timeout).count();
  bool may_be_stale = true;
  while (true) {
    auto drained = Drain();
    if (drained && may_be_stale && IsStale()) drained = SkipPair();
    if (!drained) {
      Close();
      return drained;
    }
    if (newest_) break;
    may_be_stale = false;
    if (clock_.MonotonicNs() >= until_ns) return NothingYet(timeout);
    if (auto waited = Wait(until_ns); !waited) {
      Close();
      return waited;
    }
  }
  auto delivered = Deliver(frame);
  if (!delivered) Close();
  return delivered;
}

/// Takes what the drivers have, in turn, so that pairs are found in the order of time; the last one counts.
Result<void> V4l2Source::Drain() {
  bool more = true;
  while (more) {
    more = false;
    for (const CameraId id : kBothCameras) {
      const auto got = DrainOne(id);
      if (!got) return Error{got.error().code, std::string(Name(id)) + " camera " + got.error().message};
      more = more || *got;
    }
  }
  return {};
}

Result<bool> V4l2Source::DrainOne(CameraId id) {
  Camera& camera = cameras_[Index(id)];
  const auto picture = camera.device->Dequeue();
  if (!picture) return picture.error();
  if (!*picture) return false;
  ++camera.pictures;
  camera.bytes[static_cast<size_t>((*picture)->buffer)] = (*picture)->bytes;
  const auto pair = pairer_.Add(id, {(*picture)->sequence, (*picture)->timestamp_ns, (*picture)->buffer});
  for (const FramePairer::Dropped& dropped : pairer_.dropped()) {
    if (auto given = GiveBack(dropped.camera, dropped.picture); !given) return given.error();
  }
  if (pair) {
    if (auto given = SkipPair(); !given) return given.error();
    newest_ = pair;
  }
  return true;
}

Result<void> V4l2Source::GiveBack(CameraId id, const PictureTag& picture) {
  return cameras_[Index(id)].device->Requeue(picture.handle);
}

Result<void> V4l2Source::SkipPair() {
  if (!newest_) return {};
  const FramePair pair = *std::exchange(newest_, std::nullopt);
  ++skipped_pairs_;
  for (const CameraId id : kBothCameras) {
    if (auto given = GiveBack(id, pair[id]); !given) return given;
  }
  return {};
}

/// The caller stayed away for so long that the drivers ran out of buffers: theirs are then the oldest
/// pictures, and newer ones were lost.
bool V4l2Source::IsStale() const {
  if (!newest_) return false;
  const double age_ns = static_cast<double>(clock_.MonotonicNs() - newest_->exposure_ns());
  return age_ns > (options_.buffers + 1) * pairer_.frame_interval_ns();
}

Result<void> V4l2Source::Wait(int64_t until_ns) {
  std::array<pollfd, kCameraCount> fds{};
  for (const CameraId id : kBothCameras) fds[Index(id)] = {cameras_[Index(id)].device->fd(), POLLIN, 0};
  const int64_t left_ns = std::max<int64_t>(0, until_ns - clock_.MonotonicNs());
  const timespec left{left_ns / 1'000'000'000, left_ns % 1'000'000'000};
  if (ppoll(fds.data(), fds.size(), &left, nullptr) < 0 && errno != EINTR) {
    return Error{ErrorCode::kUnavailable,
                 std::string("cameras can't be waited for: ") + std::strerror(errno)};
  }
  for (const CameraId id : kBothCameras) {
    if (fds[Index(id)].revents & (POLLERR | POLLHUP | POLLNVAL)) {
      return Error{ErrorCode::kUnavailable, std::string(Name(id)) + " camera " + options_.devices[Index(id)] +
                                                ": lost; was it unplugged?"};
    }
  }
  return {};
}

Result<void> V4l2Source::Deliver(StereoFrame& frame) {
  const FramePair pair = *std::exchange(newest_, std::nullopt);
  for (const CameraId id : kBothCameras) {
    Copy(id, pair[id], frame.images[Index(id)]);
    cameras_[Index(id)].pictures = 0;
  }
  for (const CameraId id : kBothCameras) {
    if (auto given = GiveBack(id, pair[id]); !given) return given;
  }
  frame.sequence = pair.sequence;
  frame.pressure_mpa.reset();
  frame.times = {};
  frame.times.received_ns = clock_.MonotonicNs();
  frame.times.exposure_monotonic_ns = pair.exposure_ns();
  frame.times.exposure_utc_ns = clock_.UtcNs() - (frame.times.received_ns - pair.exposure_ns());
  return {};
}

/// Without the padding that some drivers put behind each line.
void V4l2Source::Copy(CameraId id, const PictureTag& picture, RawImage& image) const {
  const Camera& camera = cameras_[Index(id)];
  const std::span<const uint8_t> bytes = camera.bytes[static_cast<size_t>(picture.handle)];
  const auto line = static_cast<size_t>(options_.width_px) * (options_.format == PixelFormat::kYuyv ? 2 : 1);
  const auto stride = static_cast<size_t>(camera.device->bytes_per_line());
  image.format = options_.format;
  image.width_px = options_.width_px;
  image.height_px = options_.height_px;
  image.valid = true;
  if (stride == 0 || stride == line) {
    image.bytes.assign(bytes.begin(), bytes.end());
    return;
  }
  image.bytes.clear();
  for (size_t start = 0; start + line <= bytes.size(); start += stride) {
    const auto from = bytes.begin() + static_cast<std::ptrdiff_t>(start);
    image.bytes.insert(image.bytes.end(), from, from + static_cast<std::ptrdiff_t>(line));
  }
}

Error V4l2Source::NothingYet(std::chrono::milliseconds timeout) const {
  std::string silent;
  for (const CameraId id : kBothCameras) {
    if (cameras_[Index(id)].pictures > 0) continue;
    silent += (silent.empty() ? "" : " and ") + options_.devices[Index(id)];
  }
  return {ErrorCode::kTimeout, "no pair of pictures within " + std::to_string(timeout.count()) + " ms" +
                                   (silent.empty() ? "" : "; nothing from " + silent)};
}

SourceInfo V4l2Source::Info() const {
  return {"v4l2 " + options_.devices[0] + " + " + options_.devices[1] + ", " +
              std::to_string(options_.width_px) + "x" + std::to_string(options_.height_px) + " " +
              FormatName(options_.format) + " " + RateText(options_.frame_rate_hz) + "/s",
          options_.width_px, options_.height_px, options_.frame_rate_hz};
}

SourceCounters V4l2Source::Counters() const {
  SourceCounters counters;
  for (const CameraId id : kBothCameras) {
    const Camera& camera = cameras_[Index(id)];
    counters.damaged[Index(id)] = camera.damaged_before + (camera.device ? camera.device->damaged() : 0);
    counters.unpaired[Index(id)] = pairer_.dropped_total(id);
  }
  counters.skipped_pairs = skipped_pairs_;
  return counters;
}

}  // namespace

std::unique_ptr<FrameSource> MakeV4l2Source(V4l2Options options, Clock& clock) {
  return std::make_unique<V4l2Source>(std::move(options), clock);
}

}  // namespace taclink
