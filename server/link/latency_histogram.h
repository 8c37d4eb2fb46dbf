#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace taclink::server {

/// Counts durations in fixed steps. One thread adds, any may read; adding takes no lock and no memory.
class LatencyHistogram {
 public:
  /// Upper bounds of the steps, ms; the last step has none.
  static constexpr std::array<double, 13> kBoundsMs = {0.1, 0.2, 0.5, 1,   2,   5,   10,
                                                       20,  50,  100, 200, 500, 1000};

  struct Snapshot {
    std::array<uint64_t, kBoundsMs.size() + 1> counts{};  ///< of each step, the last above all bounds
    double sum_ms = 0;

    uint64_t total() const {
      uint64_t total = 0;
      for (const uint64_t count : counts) total += count;
      return total;
    }
  };

  void Add(double ms) {
    size_t step = 0;
    while (step < kBoundsMs.size() && ms > kBoundsMs[step]) ++step;
    counts_[step].fetch_add(1, std::memory_order_relaxed);
    sum_ms_.store(sum_ms_.load(std::memory_order_relaxed) + ms, std::memory_order_relaxed);
  }

  Snapshot Read() const {
    Snapshot out;
    for (size_t i = 0; i < counts_.size(); ++i) out.counts[i] = counts_[i].load(std::memory_order_relaxed);
    out.sum_ms = sum_ms_.load(std::memory_order_relaxed);
    return out;
  }

 private:
  std::array<std::atomic<uint64_t>, kBoundsMs.size() + 1> counts_{};
  std::atomic<double> sum_ms_ = 0;
};

}  // namespace taclink::server
