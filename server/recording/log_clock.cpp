#include "server/recording/log_clock.h"

#include <algorithm>
#include <cstdlib>

namespace taclink::server {
namespace {

// A thread that is preempted between two readings of clocks reads an offset that is wrong by as much.
constexpr int64_t kLongestReadingNs = 1'000'000;
constexpr int kTries = 10;
constexpr int64_t kSlewDivisor = 2000;  // 500 ppm

}  // namespace

std::optional<LogClock::Reading> LogClock::Read() const {
  const int64_t before_ns = clock_.MonotonicNs();
  const int64_t utc_ns = clock_.UtcNs();
  if (clock_.MonotonicNs() - before_ns > kLongestReadingNs) return std::nullopt;
  return Reading{.monotonic_ns = before_ns, .offset_ns = utc_ns - before_ns};
}

void LogClock::Begin() {
  auto reading = Read();
  for (int i = 0; i < kTries && !reading; ++i) reading = Read();
  begun_ns_ = followed_ns_ = clock_.MonotonicNs();
  offset_ns_ = reading ? reading->offset_ns : clock_.UtcNs() - clock_.MonotonicNs();
}

std::optional<int64_t> LogClock::Step() {
  const auto reading = Read();
  if (!reading) return std::nullopt;
  const int64_t off_ns = reading->offset_ns - offset_ns_;
  if (std::abs(off_ns) > kStepNs) return off_ns;
  const int64_t most_ns = (reading->monotonic_ns - followed_ns_) / kSlewDivisor;
  offset_ns_ += std::clamp(off_ns, -most_ns, most_ns);
  followed_ns_ = reading->monotonic_ns;
  return std::nullopt;
}

}  // namespace taclink::server
