#include "sensing/capture/v4l2_device.h"

#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <tuple>
#include <utility>

#include "sensing/capture/camera_finder.h"
#include "sensing/capture/v4l2_offers.h"

namespace taclink {
namespace {

int Ioctl(int fd, unsigned long request, void* argument) {
  int result = 0;
  do {
    result = ioctl(fd, request, argument);
  } while (result < 0 && errno == EINTR);
  return result;
}

uint32_t FourCc(PixelFormat format) {
  switch (format) {
    case PixelFormat::kGray8:
      return V4L2_PIX_FMT_GREY;
    case PixelFormat::kYuyv:
      return V4L2_PIX_FMT_YUYV;
    case PixelFormat::kMjpeg:
      return V4L2_PIX_FMT_MJPEG;
  }
  return 0;
}

v4l2_buffer BufferRequest(int index = 0) {
  v4l2_buffer buffer{};
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  buffer.index = static_cast<uint32_t>(index);
  return buffer;
}

// Wraps where a driver's time does.
int64_t TimestampNs(const v4l2_buffer& buffer) {
  return static_cast<int64_t>(static_cast<uint64_t>(buffer.timestamp.tv_sec) * 1'000'000'000u +
                              static_cast<uint64_t>(buffer.timestamp.tv_usec) * 1'000u);
}

std::string SizeText(int width_px, int height_px) {
  return std::to_string(width_px) + "x" + std::to_string(height_px);
}

Result<void> CheckOptions(const V4l2DeviceOptions& options) {
  const auto bad = [&](const std::string& what) {
    return Error{ErrorCode::kInvalidArgument, options.path + ": " + what};
  };
  if (options.path.empty()) return Error{ErrorCode::kInvalidArgument, "a camera's device path is empty"};
  if (options.width_px < 1 || options.height_px < 1) {
    return bad("picture size " + SizeText(options.width_px, options.height_px) + " is not positive");
  }
  if (!(options.frame_rate_hz > 0 && options.frame_rate_hz <= 1000)) {
    return bad("frame rate must be above 0 and at most 1000 per second");
  }
  if (options.buffers < 2 || options.buffers > 32) return bad("buffers must be from 2 to 32");
  return {};
}

std::string WhatThereIs() {
  std::string list;
  for (const FoundCamera& camera : ListCameras())
    list += (list.empty() ? " There are " : ", ") + Describe(camera);
  return list;
}

}  // namespace

const char* FormatName(PixelFormat format) {
  switch (format) {
    case PixelFormat::kGray8:
      return "GREY";
    case PixelFormat::kYuyv:
      return "YUYV";
    case PixelFormat::kMjpeg:
      return "MJPEG";
  }
  return "unknown";
}

Result<V4l2Device> V4l2Device::Open(const V4l2DeviceOptions& options) {
  if (auto checked = CheckOptions(options); !checked) return checked.error();
  struct stat status{};
  if (stat(options.path.c_str(), &status) == 0 && !S_ISCHR(status.st_mode)) {
    return Error{ErrorCode::kInvalidArgument, options.path + ": is not a camera, nor any other device"};
  }
  V4l2Device device(options, open(options.path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
  if (device.fd_ < 0) return device.Failed("can't be opened");
  for (const auto step : {&V4l2Device::CheckIsCamera, &V4l2Device::Negotiate, &V4l2Device::SetAsAsked,
                          &V4l2Device::MapBuffers}) {
    if (options.is_wanted && !options.is_wanted())
      return Error{ErrorCode::kUnavailable, options.path + ": answered when nobody waited for it any more"};
    if (auto done = (device.*step)(); !done) return done.error();
  }
  return device;
}

V4l2Device::V4l2Device(V4l2Device&& other) noexcept
    : options_(std::move(other.options_)),
      fd_(std::exchange(other.fd_, -1)),
      format_(other.format_),
      bytes_per_line_(other.bytes_per_line_),
      streaming_(std::exchange(other.streaming_, false)),
      buffers_(std::exchange(other.buffers_, {})),
      damaged_(other.damaged_),
      settings_(other.settings_) {}

V4l2Device& V4l2Device::operator=(V4l2Device&& other) noexcept {
  if (this == &other) return *this;
  Close();
  options_ = std::move(other.options_);
  fd_ = std::exchange(other.fd_, -1);
  format_ = other.format_;
  bytes_per_line_ = other.bytes_per_line_;
  streaming_ = std::exchange(other.streaming_, false);
  buffers_ = std::exchange(other.buffers_, {});
  damaged_ = other.damaged_;
  settings_ = other.settings_;
  return *this;
}

V4l2Device::~V4l2Device() {
  Close();
}

void V4l2Device::Close() {
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (streaming_) Ioctl(fd_, VIDIOC_STREAMOFF, &type);
  for (const Mapping& buffer : buffers_) munmap(buffer.start, buffer.size);
  if (fd_ >= 0) close(fd_);
  streaming_ = false;
  buffers_.clear();
  fd_ = -1;
}

Error V4l2Device::Failed(const std::string& doing) const {
  switch (errno) {
    case ENOENT:
    case ENXIO:
    case ENODEV:
      return {ErrorCode::kUnavailable,
              options_.path + ": " + doing + ": no such device; is the camera plugged in?" + WhatThereIs()};
    case EBUSY:
      return {ErrorCode::kUnavailable,
              options_.path + ": " + doing + ": busy; another program uses this camera"};
    case EACCES:
    case EPERM:
      return {ErrorCode::kUnavailable,
              options_.path + ": " + doing + ": no permission; add the user to the device's group ('video')"};
    default:
      return {ErrorCode::kUnavailable, options_.path + ": " + doing + ": " + std::strerror(errno)};
  }
}

Result<void> V4l2Device::CheckIsCamera() {
  const auto not_a_camera = [this](const std::string& why) {
    return Error{ErrorCode::kInvalidArgument, options_.path + ": is not a camera: " + why};
  };
  v4l2_capability capability{};
  if (Ioctl(fd_, VIDIOC_QUERYCAP, &capability) != 0) {
    return errno == ENODEV ? Failed("can't be asked what it is") : not_a_camera("no V4L2 device");
  }
  const bool own = (capability.capabilities & V4L2_CAP_DEVICE_CAPS) != 0;
  const uint32_t can = own ? capability.device_caps : capability.capabilities;
  const std::string name = reinterpret_cast<const char*>(capability.card);
  if (!(can & V4L2_CAP_VIDEO_CAPTURE)) {
    return not_a_camera("this node of '" + name +
                        "' gives no pictures; cameras often have a second node that does");
  }
  if (!(can & V4L2_CAP_STREAMING)) return not_a_camera("'" + name + "' can't stream");
  return {};
}

/// Format and rate. Without a format asked for: the first of these that the camera has at that size and rate;
/// what is not compressed shows the markers best.
Result<void> V4l2Device::Negotiate() {
  if (options_.format) {
    format_ = *options_.format;
    const auto set = SetFormat();
    return set ? SetFrameRate() : set;
  }
  std::optional<Error> refusal;
  for (const PixelFormat format : {PixelFormat::kYuyv, PixelFormat::kMjpeg, PixelFormat::kGray8}) {
    format_ = format;
    const auto size = SetFormat();
    const auto rate = size ? SetFrameRate() : size;
    if (rate) return {};
    if (rate.error().code != ErrorCode::kUnsupported) return rate;
    if (size || !refusal) refusal = rate.error();  // a rate that is missing says more
  }
  return *refusal;
}

Result<void> V4l2Device::SetFormat() {
  const std::string asked = SizeText(options_.width_px, options_.height_px) +
                            (options_.format ? std::string(" ") + FormatName(format_) : "");
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  format.fmt.pix.width = static_cast<uint32_t>(options_.width_px);
  format.fmt.pix.height = static_cast<uint32_t>(options_.height_px);
  format.fmt.pix.pixelformat = FourCc(format_);
  format.fmt.pix.field = V4L2_FIELD_NONE;
  if (Ioctl(fd_, VIDIOC_S_FMT, &format) != 0 && errno != EINVAL) return Failed("can't be set to " + asked);
  const v4l2_pix_format& got = format.fmt.pix;
  if (got.width != static_cast<uint32_t>(options_.width_px) ||
      got.height != static_cast<uint32_t>(options_.height_px) || got.pixelformat != FourCc(format_) ||
      got.field != V4L2_FIELD_NONE) {
    return Error{ErrorCode::kUnsupported, options_.path + ": does not give " + asked +
                                              " whole frames; it offers " + OfferedFormats(fd_)};
  }
  const int pixel_bytes = format_ == PixelFormat::kYuyv ? 2 : 1;
  bytes_per_line_ = format_ == PixelFormat::kMjpeg
                        ? 0
                        : std::max(static_cast<int>(got.bytesperline), options_.width_px * pixel_bytes);
  return {};
}

Result<void> V4l2Device::SetFrameRate() {
  constexpr double kTolerance = 0.02;  // 29.97 for 30 is fine
  v4l2_streamparm parameters{};
  parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  v4l2_captureparm& capture = parameters.parm.capture;
  if (Ioctl(fd_, VIDIOC_G_PARM, &parameters) != 0) {
    return errno == ENOTTY || errno == EINVAL ? Result<void>() : Failed("can't be asked for its frame rate");
  }
  if (!(capture.capability & V4L2_CAP_TIMEPERFRAME)) return {};  // it has one rate: taken as it comes
  capture.timeperframe.numerator = 1000;
  capture.timeperframe.denominator = static_cast<uint32_t>(std::lround(options_.frame_rate_hz * 1000));
  if (Ioctl(fd_, VIDIOC_S_PARM, &parameters) != 0) return Failed("can't be set to the frame rate");
  const v4l2_fract& interval = capture.timeperframe;
  const double got_hz = interval.numerator > 0 ? double{1} * interval.denominator / interval.numerator : 0;
  if (std::abs(got_hz - options_.frame_rate_hz) <= kTolerance * options_.frame_rate_hz) return {};
  return Error{ErrorCode::kUnsupported,
               options_.path + ": does not give " + RateText(options_.frame_rate_hz) +
                   " frames per second at " + SizeText(options_.width_px, options_.height_px) + " " +
                   FormatName(format_) + "; it offers " +
                   OfferedRates(fd_, FourCc(format_), options_.width_px, options_.height_px)};
}

Result<void> V4l2Device::SetAutomaticExposure() {
  // Of the two automatic modes a camera often has one only.
  auto set = SetControl(V4L2_CID_EXPOSURE_AUTO, "automatic exposure", V4L2_EXPOSURE_APERTURE_PRIORITY);
  return set ? set : SetControl(V4L2_CID_EXPOSURE_AUTO, "automatic exposure", V4L2_EXPOSURE_AUTO);
}

Result<void> V4l2Device::SetExposure(int exposure_100us) {
  auto manual = SetControl(V4L2_CID_EXPOSURE_AUTO, "auto exposure (for manual)", V4L2_EXPOSURE_MANUAL);
  if (!manual && HasControl(V4L2_CID_EXPOSURE_AUTO)) return manual;
  return SetControl(V4L2_CID_EXPOSURE_ABSOLUTE, "exposure (0.1 ms)", exposure_100us);
}

Result<void> V4l2Device::SetGain(int gain) {
  if (HasControl(V4L2_CID_AUTOGAIN)) {
    if (auto manual = SetControl(V4L2_CID_AUTOGAIN, "automatic gain", 0); !manual) return manual;
  }
  return SetControl(V4L2_CID_GAIN, "gain", gain);
}

Result<void> V4l2Device::Set(const CameraSettings& settings) {
  Result<void> set;
  if (settings.automatic_exposure) set = SetAutomaticExposure();
  if (set && settings.exposure_100us) set = SetExposure(*settings.exposure_100us);
  if (set && settings.gain) set = SetGain(*settings.gain);
  settings_ = ReadSettings();
  return set;
}

CameraSettings V4l2Device::ReadSettings() const {
  const auto read = [this](uint32_t id, const char* name) -> std::optional<int> {
    const auto value = GetControl(id, name);
    return value ? std::optional(*value) : std::nullopt;
  };
  CameraSettings out;
  const auto mode = read(V4L2_CID_EXPOSURE_AUTO, "automatic exposure");
  out.automatic_exposure = mode && *mode != V4L2_EXPOSURE_MANUAL && *mode != V4L2_EXPOSURE_SHUTTER_PRIORITY;
  if (!out.automatic_exposure) out.exposure_100us = read(V4L2_CID_EXPOSURE_ABSOLUTE, "exposure");
  out.gain = read(V4L2_CID_GAIN, "gain");
  return out;
}

bool V4l2Device::HasControl(uint32_t id) const {
  v4l2_queryctrl query{};
  query.id = id;
  return Ioctl(fd_, VIDIOC_QUERYCTRL, &query) == 0 && !(query.flags & V4L2_CTRL_FLAG_DISABLED);
}

Result<void> V4l2Device::SetControl(uint32_t id, const char* name, int value) {
  v4l2_queryctrl query{};
  query.id = id;
  if (Ioctl(fd_, VIDIOC_QUERYCTRL, &query) != 0 && errno != EINVAL && errno != ENOTTY)
    return Failed("controls");
  if (query.type == 0 || (query.flags & V4L2_CTRL_FLAG_DISABLED)) {
    return Error{ErrorCode::kUnsupported, options_.path + ": has no control for " + name + "; leave it out"};
  }
  if (query.type == V4L2_CTRL_TYPE_INTEGER && (value < query.minimum || value > query.maximum)) {
    return Error{ErrorCode::kInvalidArgument,
                 options_.path + ": " + name + " must be from " + std::to_string(query.minimum) + " to " +
                     std::to_string(query.maximum) + ", not " + std::to_string(value)};
  }
  v4l2_control control{id, value};
  if (Ioctl(fd_, VIDIOC_S_CTRL, &control) == 0) return {};
  if (errno == EINVAL || errno == ERANGE) {
    return Error{ErrorCode::kUnsupported,
                 options_.path + ": does not take " + std::to_string(value) + " for " + name};
  }
  return Failed(std::string("can't set ") + name);
}

Result<int> V4l2Device::GetControl(uint32_t id, const char* name) const {
  v4l2_control control{id, 0};
  if (Ioctl(fd_, VIDIOC_G_CTRL, &control) == 0) return control.value;
  if (errno != EINVAL && errno != ENOTTY) return Failed(std::string("can't read ") + name);
  return Error{ErrorCode::kUnsupported, options_.path + ": has no control for " + name};
}

Result<void> V4l2Device::MapBuffers() {
  v4l2_requestbuffers request{};
  request.count = static_cast<uint32_t>(options_.buffers);
  request.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  request.memory = V4L2_MEMORY_MMAP;
  if (Ioctl(fd_, VIDIOC_REQBUFS, &request) != 0) return Failed("gives no buffers");
  if (request.count < static_cast<uint32_t>(options_.buffers)) {
    return Error{ErrorCode::kUnsupported, options_.path + ": gives only " + std::to_string(request.count) +
                                              " of " + std::to_string(options_.buffers) + " buffers"};
  }
  for (int i = 0; i < static_cast<int>(request.count); ++i) {
    v4l2_buffer buffer = BufferRequest(i);
    if (Ioctl(fd_, VIDIOC_QUERYBUF, &buffer) != 0) return Failed("gives no buffer");
    void* const start = mmap(nullptr, buffer.length, PROT_READ | PROT_WRITE, MAP_SHARED, fd_,
                             static_cast<off_t>(buffer.m.offset));
    if (start == MAP_FAILED) return Failed("its buffers can't be mapped");
    buffers_.push_back({start, buffer.length});
  }
  return {};
}

Result<void> V4l2Device::StartStreaming() {
  for (int i = 0; i < buffer_count(); ++i) {
    if (auto queued = Requeue(i); !queued) return queued;
  }
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (Ioctl(fd_, VIDIOC_STREAMON, &type) != 0) {
    return errno == ENOSPC ? Error{ErrorCode::kResourceExhausted,
                                   options_.path +
                                       ": can't stream: no bandwidth left on its USB bus; use MJPEG, a "
                                       "lower rate, or another bus"}
                           : Failed("can't stream");
  }
  streaming_ = true;
  return {};
}

Result<std::optional<DriverPicture>> V4l2Device::Dequeue() {
  while (true) {
    v4l2_buffer buffer = BufferRequest();
    if (Ioctl(fd_, VIDIOC_DQBUF, &buffer) != 0) {
      if (errno == EAGAIN) return std::optional<DriverPicture>();
      return Failed("stopped giving pictures");
    }
    const bool damaged = (buffer.flags & V4L2_BUF_FLAG_ERROR) != 0 || buffer.bytesused == 0 ||
                         buffer.bytesused > buffers_[buffer.index].size;
    if (!damaged && (buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) != V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC) {
      return Error{ErrorCode::kUnsupported,
                   options_.path + ": its driver does not stamp pictures with the monotonic clock"};
    }
    const int index = static_cast<int>(buffer.index);
    if (!damaged) {
      const auto* const start = static_cast<const uint8_t*>(buffers_[buffer.index].start);
      return std::optional(
          DriverPicture{{start, buffer.bytesused}, buffer.sequence, TimestampNs(buffer), index});
    }
    ++damaged_;
    if (auto queued = Requeue(index); !queued) return queued.error();
  }
}

Result<void> V4l2Device::Requeue(int index) {
  v4l2_buffer buffer = BufferRequest(index);
  if (Ioctl(fd_, VIDIOC_QBUF, &buffer) != 0) return Failed("takes no buffer back");
  return {};
}

}  // namespace taclink
