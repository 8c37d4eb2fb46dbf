#pragma once

#include <atomic>
#include <cstddef>

namespace taclink::server {

/// Memory that several may use together. Any thread.
class ByteBudget {
 public:
  explicit ByteBudget(size_t limit) : limit_(limit) {}
  ByteBudget(const ByteBudget&) = delete;
  ByteBudget& operator=(const ByteBudget&) = delete;

  /// False: there is not so much left, and nothing was taken.
  bool TryTake(size_t bytes) {
    size_t used = used_;
    do {
      if (used > limit_ || bytes > limit_ - used) return false;
    } while (!used_.compare_exchange_weak(used, used + bytes));
    return true;
  }
  /// Also beyond the limit.
  void Take(size_t bytes) { used_ += bytes; }
  void Give(size_t bytes) { used_ -= bytes; }
  /// What is in use stays so.
  void SetLimit(size_t limit) { limit_ = limit; }
  size_t used() const { return used_; }

 private:
  std::atomic<size_t> limit_;
  std::atomic<size_t> used_ = 0;
};

}  // namespace taclink::server
