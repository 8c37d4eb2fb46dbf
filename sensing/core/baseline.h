#pragma once

#include <cstdint>
#include <vector>

namespace taclink {

/// How the shape was taken against which displacements are measured.
enum class BaselineOrigin : uint8_t {
  kNone,         ///< there is none yet
  kStart,        ///< from the first pictures of the link
  kCalibration,  ///< with new cameras, on demand
  kTare,         ///< on demand, while nothing touched
  kForcedTare,   ///< on demand, whatever touched; and by any tare after that, until rest is taken again
};

enum class DriftState : uint8_t {
  kOff,        ///< drift is not followed, by option
  kFollowing,  ///< nothing touches: the baseline follows the skin
  kHeld,       ///< touched, touched until just now, or not sure: the baseline stays
};

struct Baseline {
  BaselineOrigin origin = BaselineOrigin::kNone;
  int64_t taken_utc_ns = 0;  ///< exposure of its newest picture, since 1970-01-01; 0: there is none
  /// When the cameras were calibrated that it was taken with, since 1970-01-01; 0: not known.
  int64_t calibrated_utc_ns = 0;
  double drift_mm = 0;  ///< how far it has followed the skin since: of the marker that went furthest
  DriftState drift_state = DriftState::kOff;
  /// Markers that neither camera showed when it was taken, by index, ascending: broken off, or hidden for
  /// good.
  std::vector<int> missing_markers = {};
};

struct TareOptions {
  int frames = 10;     ///< to average over
  bool force = false;  ///< even while touched, moved or with few markers
  bool undo = false;   ///< undo the last tare instead
};

/// A baseline that was taken.
struct TareSummary {
  int frames = 0;
  bool undone = false;        ///< the last tare, which had moved the baseline by shift_mm
  bool forced = false;        ///< without that it would have been refused
  double shift_mm = 0;        ///< against the baseline before: of the marker that is furthest off
  double previous_age_s = 0;  ///< of the baseline before
};

}  // namespace taclink
