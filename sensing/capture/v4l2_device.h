#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "sensing/capture/camera_device.h"
#include "sensing/core/frame.h"
#include "sensing/core/result.h"

namespace taclink {

/// What is asked of one camera.
struct V4l2DeviceOptions {
  std::string path;  ///< best a stable one, /dev/v4l/by-path/...
  int width_px = 640;
  int height_px = 480;
  double frame_rate_hz = 30;
  std::optional<PixelFormat> format = PixelFormat::kYuyv;  ///< none: the best it has at that size and rate
  CameraSettings settings = {};  ///< a time turns automatic exposure off, a gain automatic gain
  int buffers = 4;               ///< pictures that the driver can hold
  /// Asked before each step of Open, one of which may have hung for long: a camera that nobody waits for any
  /// more is not changed. Empty: it is wanted.
  std::function<bool()> is_wanted = {};
};

/// One camera under Linux' V4L2 interface, with memory-mapped buffers. Owns the device: while it lives nobody
/// else can change the format. Used from one thread. After an error kUnavailable from Dequeue or Requeue only
/// destruction helps.
///
/// Error codes: kUnavailable: not there, busy, no permission, unplugged; kInvalidArgument: no camera, or an
/// option no camera could fulfil; kUnsupported: this camera can't; kResourceExhausted: its USB bus is full.
/// All messages name the device, what was asked and, where the camera decides, what it offers.
class V4l2Device {
 public:
  /// Sets format, rate and controls exactly as asked or fails. Does not stream yet. kUnavailable also: it is
  /// not wanted any more.
  static Result<V4l2Device> Open(const V4l2DeviceOptions& options);

  V4l2Device(V4l2Device&& other) noexcept;
  V4l2Device& operator=(V4l2Device&& other) noexcept;
  ~V4l2Device();

  Result<void> StartStreaming();

  /// The next picture in the driver's queue, oldest first; none: nothing new yet. Damaged ones go back to the
  /// driver and are counted. Wait with poll(POLLIN) on fd(); it also reports the loss of the device.
  Result<std::optional<DriverPicture>> Dequeue();
  Result<void> Requeue(int buffer);

  /// As FrameSource::SetCamera.
  Result<void> Set(const CameraSettings& settings);
  /// As CameraDevice::settings.
  const CameraSettings& settings() const { return settings_; }
  /// Any control of the camera by its V4L2 number. `name` is for the error message.
  Result<void> SetControl(uint32_t id, const char* name, int value);
  Result<int> GetControl(uint32_t id, const char* name) const;

  int fd() const { return fd_; }
  const std::string& path() const { return options_.path; }
  PixelFormat format() const { return format_; }
  int bytes_per_line() const { return bytes_per_line_; }  ///< at least the picture's width; 0 for MJPEG
  int buffer_count() const { return static_cast<int>(buffers_.size()); }
  uint64_t damaged() const { return damaged_; }  ///< pictures marked bad by the driver, or empty

 private:
  struct Mapping {
    void* start = nullptr;
    size_t size = 0;
  };

  V4l2Device(V4l2DeviceOptions options, int fd) : options_(std::move(options)), fd_(fd) {}
  Result<void> CheckIsCamera();
  Result<void> Negotiate();
  Result<void> SetFormat();
  Result<void> SetFrameRate();
  Result<void> SetAsAsked() { return Set(options_.settings); }
  Result<void> SetAutomaticExposure();
  Result<void> SetExposure(int exposure_100us);
  Result<void> SetGain(int gain);
  CameraSettings ReadSettings() const;
  bool HasControl(uint32_t id) const;
  Result<void> MapBuffers();
  Error Failed(const std::string& doing) const;  ///< from errno
  void Close();

  V4l2DeviceOptions options_;
  int fd_ = -1;
  PixelFormat format_ = PixelFormat::kYuyv;
  int bytes_per_line_ = 0;
  bool streaming_ = false;
  std::vector<Mapping> buffers_;
  uint64_t damaged_ = 0;
  CameraSettings settings_;  // as read
};

/// "YUYV", "MJPEG" or "GREY", as people look for it in a camera's data sheet.
const char* FormatName(PixelFormat format);

}  // namespace taclink
