#pragma once

#include <cstdint>
#include <optional>

#include "sensing/core/clock.h"

namespace taclink::server {

/// Finds steps of the UTC clock against the monotonic one: the clock was set, or the machine was suspended
/// (CLOCK_MONOTONIC stands still meanwhile). Slewing at up to 500 ppm, as NTP does it, is no step. Each
/// reader has its own watch; one thread.
class ClockWatch {
 public:
  static constexpr int64_t kThresholdNs = 500'000'000;

  /// By how much UTC has stepped since the last call, if by more than the threshold; positive: forward. Both
  /// times must have been read at the same moment. The first call has nothing to compare with.
  std::optional<int64_t> StepNs(int64_t monotonic_ns, int64_t utc_ns);

  /// The same with the times of `clock`. A thread that is preempted between two readings would see a step
  /// that is none: where readings take too long nothing is judged, and the next call compares with the last
  /// good ones.
  std::optional<int64_t> Poll(const Clock& clock);

 private:
  struct Reading {
    int64_t monotonic_ns = 0;
    int64_t utc_ns = 0;
  };
  std::optional<Reading> last_;
};

}  // namespace taclink::server
