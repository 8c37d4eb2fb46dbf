#pragma once

#include <algorithm>
#include <cstdint>

namespace taclink::server {

/// Lets `burst` things pass at once and `per_s` in the long run. One thread, or guarded by its owner.
class TokenBucket {
 public:
  TokenBucket(double burst, double per_s) : burst_(burst), per_s_(per_s), tokens_(burst) {}

  /// Whether one more may pass. `now_ns`: monotonic.
  bool Take(int64_t now_ns) {
    Refill(now_ns);
    if (tokens_ < 1) return false;
    tokens_ -= 1;
    return true;
  }
  /// How long until Take succeeds; 0: now.
  int64_t WaitNs(int64_t now_ns) {
    Refill(now_ns);
    return tokens_ >= 1 ? 0 : static_cast<int64_t>((1 - tokens_) / per_s_ * 1e9) + 1;
  }
  bool IsFull(int64_t now_ns) const {
    return tokens_ + static_cast<double>(now_ns - last_ns_) * 1e-9 * per_s_ >= burst_;
  }

 private:
  void Refill(int64_t now_ns) {
    if (last_ns_ != 0 && now_ns > last_ns_)
      tokens_ = std::min(burst_, tokens_ + static_cast<double>(now_ns - last_ns_) * 1e-9 * per_s_);
    last_ns_ = now_ns;
  }

  double burst_, per_s_;
  double tokens_;
  int64_t last_ns_ = 0;  // 0: never
};

}  // namespace taclink::server
