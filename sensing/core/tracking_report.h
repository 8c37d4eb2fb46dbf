#pragma once

#include <array>
#include <cstdint>

#include "sensing/core/camera_model.h"

namespace taclink {

/// Where a frame's labels come from.
enum class TrackingMode : uint8_t {
  kNone,      ///< no labels: no rest shape yet
  kAcquired,  ///< from the full pictures
  kTracked,   ///< from small windows around where the markers were expected
};

/// Why a frame was acquired.
enum class AcquireReason : uint8_t {
  kNone,    ///< it was not
  kFirst,   ///< no frame before it
  kGap,     ///< frames are missing before it
  kCamera,  ///< a camera has come back
  kLoss,    ///< too many markers were lost in it
  kRetry,   ///< few markers are seen: tried from time to time
  kForced,  ///< by option
};
constexpr const char* Name(AcquireReason reason) {
  switch (reason) {
    case AcquireReason::kNone:
      return "none";
    case AcquireReason::kFirst:
      return "first";
    case AcquireReason::kGap:
      return "gap";
    case AcquireReason::kCamera:
      return "camera";
    case AcquireReason::kLoss:
      return "loss";
    case AcquireReason::kRetry:
      return "retry";
    case AcquireReason::kForced:
      return "forced";
  }
  return "unknown";
}

/// How one picture's labels were got.
struct CameraTracking {
  double share_read = 0;  ///< of the picture's pixels, 1 when acquired
  int verified = 0;       ///< markers that look as before, but for a small shift
  int measured = 0;       ///< markers whose spot was measured again
  int searched = 0;       ///< markers without a label that were looked for
  int found = 0;          ///< of these, with success
  int dropped = 0;        ///< labels given up in this frame: the spot is gone, or in doubt
};

struct TrackingReport {
  TrackingMode mode = TrackingMode::kNone;
  AcquireReason reason = AcquireReason::kNone;
  std::array<CameraTracking, kCameraCount> cameras;
};

}  // namespace taclink
