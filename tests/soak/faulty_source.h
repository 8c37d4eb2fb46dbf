#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <random>
#include <stdexcept>

#include "sensing/capture/frame_source.h"
#include "sensing/core/clock.h"

namespace taclink::server {

/// Faults that all sources injected.
struct FaultCounts {
  std::atomic<uint64_t> stalls = 0, errors = 0, exceptions = 0, bursts = 0, refused_starts = 0;
};

/// Frames without pictures at a rate, and faults at random from a seed: it stalls, fails, throws, does not
/// start, and delivers many frames at once. Its sequence always rises.
class FaultySource final : public FrameSource {
 public:
  FaultySource(double rate_hz, uint64_t seed, Clock& clock, FaultCounts& counts)
      : period_ns_(static_cast<int64_t>(1e9 / rate_hz)), clock_(clock), counts_(counts), random_(seed) {}

  Result<void> Start() override {
    if (OneIn(3)) return ++counts_.refused_starts, Error{ErrorCode::kUnavailable, "the camera is not there"};
    next_ns_ = clock_.MonotonicNs();
    return {};
  }

  Result<void> Next(StereoFrame& frame, std::chrono::milliseconds timeout) override {
    if (OneIn(400)) return ++counts_.errors, Error{ErrorCode::kUnavailable, "the camera was unplugged"};
    if (OneIn(600)) {
      ++counts_.exceptions;
      throw std::runtime_error("a library below the camera failed");
    }
    if (OneIn(300)) {
      ++counts_.stalls;
      next_ns_ += std::chrono::nanoseconds(std::chrono::milliseconds(random_() % 400)).count();
    }
    if (OneIn(200)) {
      ++counts_.bursts;
      burst_ = 20;
    }
    if (burst_ > 0) {
      --burst_;
    } else if (!WaitUntil(next_ns_, timeout)) {
      return Error{ErrorCode::kTimeout, "nothing yet"};
    } else {
      next_ns_ += period_ns_;
    }
    sequence_ += OneIn(50) ? 3 : 1;  // some are lost on the way
    frame.sequence = sequence_;
    frame.times = {};
    frame.times.received_ns = frame.times.exposure_monotonic_ns = clock_.MonotonicNs();
    frame.times.exposure_utc_ns = clock_.UtcNs();
    return {};
  }

  SourceInfo Info() const override { return {"faulty", 640, 480, 1e9 / static_cast<double>(period_ns_)}; }

 private:
  bool OneIn(uint64_t n) { return random_() % n == 0; }
  bool WaitUntil(int64_t time_ns, std::chrono::milliseconds timeout) {
    const int64_t limit_ns = clock_.MonotonicNs() + std::chrono::nanoseconds(timeout).count();
    clock_.SleepUntilMonotonicNs(std::min(time_ns, limit_ns));
    return time_ns <= limit_ns;
  }

  const int64_t period_ns_;
  Clock& clock_;
  FaultCounts& counts_;
  std::mt19937_64 random_;
  uint64_t sequence_ = 0;
  int64_t next_ns_ = 0;
  int burst_ = 0;
};

}  // namespace taclink::server
