#pragma once

#include <cstdint>

namespace taclink {

/// Time is injected, so that tests and replays have their own.
class Clock {
 public:
  virtual ~Clock() = default;
  virtual int64_t MonotonicNs() const = 0;  ///< CLOCK_MONOTONIC
  virtual int64_t UtcNs() const = 0;        ///< since 1970-01-01
  virtual void SleepUntilMonotonicNs(int64_t time_ns) = 0;
};

Clock& SystemClock();

}  // namespace taclink
