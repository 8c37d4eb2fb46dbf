#pragma once

#include <cstdint>
#include <optional>

#include "sensing/core/clock.h"

namespace taclink::server {

/// The time line of one log: log times are monotonic times plus one offset. The offset follows the UTC clock
/// as slowly as one is slewed (500 ppm); a clock that was set leaves it as it is until another log begins. So
/// times within a log never jump, whatever happens to the wall clock. One thread.
class LogClock {
 public:
  static constexpr int64_t kStepNs = 500'000'000;

  /// `clock` must outlive it.
  explicit LogClock(Clock& clock) : clock_(clock) { Begin(); }

  /// A log begins, with the UTC clock as it is now.
  void Begin();
  int64_t AgeNs() const { return clock_.MonotonicNs() - begun_ns_; }  ///< of the log
  /// Of a monotonic time, since 1970-01-01 UTC.
  int64_t Utc(int64_t monotonic_ns) const { return monotonic_ns + offset_ns_; }
  int64_t NowUtc() const { return Utc(clock_.MonotonicNs()); }
  /// Follows the UTC clock. By how much it is off the log's time line (positive: ahead), where that is more
  /// than kStepNs: it was set, and another log should begin. The same is returned until Begin.
  std::optional<int64_t> Step();

 private:
  struct Reading {
    int64_t monotonic_ns = 0, offset_ns = 0;  // UTC minus monotonic
  };
  std::optional<Reading> Read() const;

  Clock& clock_;
  int64_t offset_ns_ = 0;
  int64_t followed_ns_ = 0;  // monotonic: the offset was last moved
  int64_t begun_ns_ = 0;     // monotonic
};

}  // namespace taclink::server
