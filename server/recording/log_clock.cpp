#include "server/recording/log_clock.h"

namespace taclink::server {
namespace {

// A thread that is preempted between two readings of clocks reads an offset that is wrong by as much.
constexpr int64_t kLongestReadingNs = 1'000'000;

}  // namespace

LogClock::LogClock(Clock& clock)
    : clock_(clock), offset_ns_(clock.UtcNs() - clock.MonotonicNs()), begun_ns_(clock.MonotonicNs()) {
  Step();
}

std::optional<int64_t> LogClock::Step() {
  const int64_t before_ns = clock_.MonotonicNs();
  const int64_t utc_ns = clock_.UtcNs();
  if (clock_.MonotonicNs() - before_ns > kLongestReadingNs) return std::nullopt;
  offset_ns_ = utc_ns - before_ns;
  return watch_.StepNs(before_ns, utc_ns);
}

}  // namespace taclink::server
