#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

namespace taclink::server {

/// Lets through so many a second of what comes with its date. The schedule goes on from its own last date, so
/// that what comes a little early or late does not lower the rate in the long run.
class RateLimit {
 public:
  /// 0: no limit.
  explicit RateLimit(double max_rate_hz)
      : period_ns_(max_rate_hz > 0 ? static_cast<int64_t>(std::min(1e9 / max_rate_hz, kLongestPeriodNs))
                                   : 0) {}

  bool limited() const { return period_ns_ > 0; }

  /// True: it may pass, and counts.
  bool Due(int64_t date_ns) {
    if (!limited()) return true;
    if (date_ns < next_due_ns_ - std::min(period_ns_ / kEarlyDivisor, kEarlyMaxNs)) return false;
    next_due_ns_ += period_ns_;
    if (next_due_ns_ <= date_ns) next_due_ns_ = date_ns + period_ns_;
    return true;
  }

 private:
  // How early a frame may come and still count, for cameras are not exactly regular: a part of the period,
  // and at most.
  static constexpr int64_t kEarlyDivisor = 4;
  static constexpr int64_t kEarlyMaxNs = 10'000'000;
  static constexpr double kLongestPeriodNs = 1e15;  // any client may ask for any rate

  int64_t period_ns_;
  int64_t next_due_ns_ = std::numeric_limits<int64_t>::min() / 2;
};

}  // namespace taclink::server
