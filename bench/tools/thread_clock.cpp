#include "bench/tools/thread_clock.h"

#include <ctime>

namespace taclink {
namespace {

class CpuClock final : public Clock {
 public:
  int64_t MonotonicNs() const override {
    timespec now{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
  }
  int64_t UtcNs() const override { return SystemClock().UtcNs(); }
  void SleepUntilMonotonicNs(int64_t) override {}
};

}  // namespace

Clock& ThreadCpuClock() {
  static CpuClock clock;
  return clock;
}

}  // namespace taclink
