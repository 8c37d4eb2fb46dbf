#include "server/process/clock_watch.h"

#include <cstdlib>

namespace taclink::server {
namespace {

constexpr int64_t kSlewPerNs = 2000;  // 1 / 500 ppm, the most by which Linux slews a clock (adjtimex(2))
constexpr int64_t kMostReadingNs = 20'000'000;
constexpr int kTries = 3;

}  // namespace

std::optional<int64_t> ClockWatch::StepNs(int64_t monotonic_ns, int64_t utc_ns) {
  const std::optional<Reading> before = last_;
  last_ = Reading{monotonic_ns, utc_ns};
  if (!before) return std::nullopt;
  const int64_t elapsed_ns = monotonic_ns - before->monotonic_ns;
  const int64_t step_ns = (utc_ns - before->utc_ns) - elapsed_ns;
  if (std::abs(step_ns) <= kThresholdNs + std::abs(elapsed_ns) / kSlewPerNs) return std::nullopt;
  return step_ns;
}

std::optional<int64_t> ClockWatch::Poll(const Clock& clock) {
  for (int i = 0; i < kTries; ++i) {
    const int64_t before_ns = clock.MonotonicNs();
    const int64_t utc_ns = clock.UtcNs();
    const int64_t after_ns = clock.MonotonicNs();
    if (after_ns - before_ns <= kMostReadingNs) return StepNs(before_ns, utc_ns);
  }
  return std::nullopt;
}

}  // namespace taclink::server
