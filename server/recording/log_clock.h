#pragma once

#include <cstdint>
#include <optional>

#include "sensing/core/clock.h"
#include "server/process/clock_watch.h"

namespace taclink::server {

/// The time line of one log. Log times are monotonic times plus one offset, which follows a UTC clock that is
/// slewed, but not one that is set: within a log they never jump, whatever happens to the wall clock. One
/// thread.
class LogClock {
 public:
  /// `clock` must outlive it.
  explicit LogClock(Clock& clock);

  /// A log begins.
  void Begin() { begun_ns_ = clock_.MonotonicNs(); }
  int64_t AgeNs() const { return clock_.MonotonicNs() - begun_ns_; }  ///< of the log
  /// Of a monotonic time, since 1970-01-01 UTC.
  int64_t Utc(int64_t monotonic_ns) const { return monotonic_ns + offset_ns_; }
  int64_t NowUtc() const { return Utc(clock_.MonotonicNs()); }
  /// To be called often. By how much UTC has been set since the last call (positive: forward), if it has
  /// been: then another log must begin, for the times from now on are on another line.
  std::optional<int64_t> Step();

 private:
  Clock& clock_;
  ClockWatch watch_;
  int64_t offset_ns_ = 0;  // UTC minus monotonic
  int64_t begun_ns_ = 0;   // monotonic
};

}  // namespace taclink::server
