#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

#include "sensing/core/frame.h"
#include "sensing/core/result.h"

namespace taclink::server {

/// A measured gauge pressure.
struct PressureReading {
  int64_t time_ns = 0;  ///< monotonic
  double mpa = 0;
};

/// The newest readings of the pressure inside a link's skin, and the problem of their sensor. Any thread;
/// calls wait only for each other.
class PressureReadings {
 public:
  /// `who`: source of the readings, for messages ("the sensor").
  PressureReadings(PressureOrigin origin, std::chrono::milliseconds stale_after, std::string who);

  /// False: not newer than the newest reading, and ignored. Errors: kInvalidArgument (not a finite pressure
  /// within -100 and 100 kPa).
  Result<bool> Add(const PressureReading& reading);
  /// Empty: the sensor works. Returns whether the text has changed.
  bool SetTrouble(std::string trouble);
  std::string trouble() const;
  std::optional<PressureReading> Newest() const;

  /// Sets the frame's pressure at its exposure, with its origin, age and trouble.
  void Apply(StereoFrame& frame) const;

 private:
  std::string Silence(int64_t age_ns) const;

  // Constant after construction.
  const PressureOrigin origin_;
  const int64_t stale_ns_;
  const std::string who_;

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  std::array<PressureReading, 64> ring_{};  // the next index is count_ % size
  uint64_t count_ = 0;
  std::string trouble_;
};

}  // namespace taclink::server
