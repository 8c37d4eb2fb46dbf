#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <string>

#include "sensing/core/frame.h"
#include "sensing/core/result.h"

namespace taclink {

/// What a source delivers, known after Start.
struct SourceInfo {
  std::string description;  ///< "v4l2 /dev/video0 + /dev/video2, 640x480 YUYV 30/s"
  int width_px = 0;
  int height_px = 0;
  double frame_rate_hz = 0;
};

/// Pictures that were taken but not delivered, since the source was made.
struct SourceCounters {
  std::array<uint64_t, kCameraCount> damaged{};   ///< by camera: marked bad by the driver, or empty
  std::array<uint64_t, kCameraCount> unpaired{};  ///< by camera: the other camera had none of that time
  uint64_t skipped_pairs = 0;                     ///< newer ones were there when the caller asked
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
  /// it is late. Errors: kTimeout (nothing yet, call again), kUnavailable (lost: Start again), kEndOfData.
  virtual Result<void> Next(StereoFrame& frame, std::chrono::milliseconds timeout) = 0;

  virtual SourceInfo Info() const = 0;
  virtual SourceCounters Counters() const { return {}; }
};

}  // namespace taclink
