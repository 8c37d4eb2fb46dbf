#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/frame.h"
#include "sensing/core/result.h"

namespace taclink {

/// How a camera exposes; what is not set stays as it is, or is not known.
struct CameraSettings {
  bool automatic_exposure = false;         ///< the camera decides; then without a time
  std::optional<int> exposure_100us = {};  ///< exposure time, 0.1 ms
  std::optional<int> gain = {};            ///< camera's own units

  /// What `newer` sets, over this.
  void Take(const CameraSettings& newer);
};

/// One camera of a source, in words for people.
struct SourceCamera {
  std::string configured;        ///< as the configuration names it
  std::string device;            ///< what was found: "/dev/video0 (usb:1-2, serial:A1)"; empty: not open
  std::string format;            ///< "YUYV 640x480"; empty: not open
  std::string trouble;           ///< why it gives no pictures now; empty: it does
  CameraSettings settings = {};  ///< as read from it when it was opened or set
};

/// What a source delivers, known after Start.
struct SourceInfo {
  std::string description;  ///< "v4l2 /dev/video0 + /dev/video2, 640x480 YUYV 30/s"
  int width_px = 0;
  int height_px = 0;
  double frame_rate_hz = 0;
  std::vector<SourceCamera> cameras = {};  ///< top, bottom; none: the source has no cameras
  /// Monotonic: when its first frame is due, which may be long after Start; 0: at once.
  int64_t begins_at_ns = 0;
};

/// What became of the pictures since the source was made.
struct SourceCounters {
  std::array<uint64_t, kCameraCount> pictures{};  ///< by camera: came whole out of the driver
  std::array<double, kCameraCount> rate_hz{};     ///< by camera: as measured lately; 0: gives none
  /// By camera: exposed, by the driver's count, but never handed out by it.
  std::array<uint64_t, kCameraCount> lost{};
  std::array<uint64_t, kCameraCount> damaged{};   ///< by camera: marked bad by the driver, or empty
  std::array<uint64_t, kCameraCount> unpaired{};  ///< by camera: the other camera had none of that time
  /// By camera: the driver's timestamp was no monotonic time, so that of arrival was taken.
  std::array<uint64_t, kCameraCount> stamped_on_arrival{};
  uint64_t skipped_pairs = 0;  ///< newer ones were there when the caller asked
  uint64_t info_changes = 0;   ///< rises whenever Info would say something else
};

/// The seam between what makes pictures (cameras, files, a simulation, a log) and all that follows.
/// Used from one thread.
class FrameSource {
 public:
  virtual ~FrameSource() = default;

  /// Opens what there is to open. May be called again after a failure or after kUnavailable from Next.
  /// Errors: kUnavailable (may work later), kInvalidArgument and kUnsupported (will not).
  virtual Result<void> Start() = 0;

  /// Waits for the next pair and writes it into `frame`, whose buffers it reuses. Skips to the newest pair if
  /// it is late. While a source has only one of its cameras the other image is not valid. Errors: kTimeout
  /// (nothing yet, call again), kUnavailable (lost: Start again), kEndOfData.
  virtual Result<void> Next(StereoFrame& frame, std::chrono::milliseconds timeout) = 0;

  /// From the next pictures on, also after another Start. Errors: kUnsupported (nothing to set),
  /// kInvalidArgument (what the camera takes is in the message), kUnavailable (the camera is not there now).
  virtual Result<void> SetCamera(CameraId, const CameraSettings&) {
    return Error{ErrorCode::kUnsupported, "this link's pictures come from no camera that can be set"};
  }

  /// Before Start: what the cameras are to be set to when they are opened.
  virtual void Remember(CameraId, const CameraSettings&) {}

  /// The source produces a pair when it is asked for one. The caller then asks for the next pair only after
  /// it has passed the last one on, so that no pair is skipped.
  virtual bool WaitsForReader() const { return false; }

  virtual SourceInfo Info() const = 0;
  virtual SourceCounters Counters() const { return {}; }
};

inline void CameraSettings::Take(const CameraSettings& newer) {
  if (newer.automatic_exposure || newer.exposure_100us) {
    automatic_exposure = newer.automatic_exposure;
    exposure_100us = newer.exposure_100us;
  }
  if (newer.gain) gain = newer.gain;
}

}  // namespace taclink
