#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "sensing/capture/frame_source.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/frame.h"
#include "sensing/core/result.h"

namespace taclink {

/// A picture in the driver's memory, until its buffer is given back.
struct DriverPicture {
  std::span<const uint8_t> bytes;
  uint32_t sequence = 0;     ///< the driver's count of exposures; wraps
  int64_t timestamp_ns = 0;  ///< CLOCK_MONOTONIC: start of exposure or, with some drivers, end of transfer
  int buffer = 0;
};

/// What an open camera gives.
struct CameraFormat {
  PixelFormat pixels = PixelFormat::kYuyv;
  int width_px = 0;
  int height_px = 0;
  int bytes_per_line = 0;  ///< at least the picture's width; 0 for MJPEG
};

/// Into `image`, whose buffer is reused, without the padding that some drivers put behind each line.
void CopyPicture(std::span<const uint8_t> bytes, const CameraFormat& format, RawImage& image);

/// One open camera that streams. Used from one thread.
class CameraDevice {
 public:
  virtual ~CameraDevice() = default;

  /// The next picture in the driver's queue, oldest first; none: nothing new yet. Error: it is lost, only
  /// closing it helps.
  virtual Result<std::optional<DriverPicture>> Dequeue() = 0;
  virtual Result<void> Requeue(int buffer) = 0;
  /// As FrameSource::SetCamera.
  virtual Result<void> Set(const CameraSettings&) {
    return Error{ErrorCode::kUnsupported, description() + " can't be set"};
  }

  /// As read when it was opened or set.
  virtual CameraSettings settings() const { return {}; }

  virtual CameraFormat format() const = 0;
  virtual std::string description() const = 0;  ///< "/dev/video0 (usb:1-2, serial:A1)"
  virtual int buffer_count() const = 0;
  virtual uint64_t damaged() const = 0;  ///< pictures marked bad by the driver, empty or cut short
  virtual uint64_t stamped_on_arrival() const = 0;
};

using OpenedCamera = Result<std::unique_ptr<CameraDevice>>;
using CameraDevices = std::array<CameraDevice*, kCameraCount>;

/// Closes `old` (null: none), then calls `open`, both on a detached thread that outlives the future where a
/// camera hangs: `open` refers to nothing that may go before the process does. Without a thread `old` is
/// closed by the caller's and the result is that error.
std::future<OpenedCamera> OpenDetached(std::unique_ptr<CameraDevice> old, std::function<OpenedCamera()> open);

/// What a pair of cameras needs of the machine; tests have one without any.
class CameraSystem {
 public:
  virtual ~CameraSystem() = default;

  /// Closes `old` if there is one, then opens the camera and starts it. Returns at once: a camera that does
  /// not answer can hold the kernel up for seconds, and the other one must not wait. Nor does who drops the
  /// future: what is opened later is closed by the thread that opened it.
  virtual std::future<OpenedCamera> Open(CameraId id, std::unique_ptr<CameraDevice> old) = 0;
  /// Of what will be opened from now on.
  virtual void Remember(CameraId, const CameraSettings&) {}

  /// Until a device (null: not there) has a picture or trouble, or until that time. What the trouble is, by
  /// camera; empty: none.
  virtual std::array<std::string, kCameraCount> Wait(const CameraDevices& devices, int64_t until_ns) = 0;
};

}  // namespace taclink
