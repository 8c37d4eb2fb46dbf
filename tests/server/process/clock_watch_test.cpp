#include "server/process/clock_watch.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <optional>

#include "sensing/core/clock.h"

namespace taclink::server {
namespace {

constexpr int64_t kWatchSecondNs = 1'000'000'000;
constexpr int64_t kWatchUtcNs = 1'700'000'000 * kWatchSecondNs;

TEST(ClockWatchTest, AStepIsReportedOnceWithItsSize) {
  ClockWatch watch;
  EXPECT_EQ(watch.StepNs(kWatchSecondNs, kWatchUtcNs), std::nullopt);  // nothing to compare with
  EXPECT_EQ(watch.StepNs(2 * kWatchSecondNs, kWatchUtcNs + kWatchSecondNs), std::nullopt);
  EXPECT_EQ(watch.StepNs(3 * kWatchSecondNs, kWatchUtcNs + 62 * kWatchSecondNs), 60 * kWatchSecondNs);
  EXPECT_EQ(watch.StepNs(4 * kWatchSecondNs, kWatchUtcNs + 63 * kWatchSecondNs), std::nullopt);
  EXPECT_EQ(watch.StepNs(5 * kWatchSecondNs, kWatchUtcNs + 4 * kWatchSecondNs), -60 * kWatchSecondNs);
  EXPECT_EQ(watch.StepNs(6 * kWatchSecondNs, kWatchUtcNs + 5 * kWatchSecondNs), std::nullopt);
}

TEST(ClockWatchTest, TheThresholdHoldsInBothDirections) {
  for (const int64_t sign : {-1, 1}) {
    ClockWatch watch;
    watch.StepNs(kWatchSecondNs, kWatchUtcNs);
    EXPECT_EQ(watch.StepNs(kWatchSecondNs, kWatchUtcNs + sign * ClockWatch::kThresholdNs), std::nullopt)
        << sign;
    EXPECT_EQ(watch.StepNs(kWatchSecondNs, kWatchUtcNs + sign * (2 * ClockWatch::kThresholdNs + 1)),
              sign * (ClockWatch::kThresholdNs + 1))
        << sign;
  }
}

TEST(ClockWatchTest, SlewingIsNoStepHoweverLong) {
  ClockWatch every_second, every_hour;
  for (int64_t s = 0; s <= 3 * 3600; ++s) {
    const int64_t monotonic_ns = s * kWatchSecondNs,
                  utc_ns = kWatchUtcNs + s * (kWatchSecondNs + kWatchSecondNs / 2000);
    EXPECT_EQ(every_second.StepNs(monotonic_ns, utc_ns), std::nullopt) << s;
    if (s % 3600 == 0) {
      EXPECT_EQ(every_hour.StepNs(monotonic_ns, utc_ns), std::nullopt) << s;
    }
  }
}

// Its thread is preempted between reading the one clock and the other, as often as the test says.
class PreemptedClock final : public Clock {
 public:
  int64_t MonotonicNs() const override { return now_ns_; }
  int64_t UtcNs() const override {
    const int64_t utc_ns = kWatchUtcNs + now_ns_ + step_ns;
    if (preemptions > 0) {
      --preemptions;
      now_ns_ += 2 * kWatchSecondNs;
    }
    return utc_ns;
  }
  void SleepUntilMonotonicNs(int64_t time_ns) override { now_ns_ = time_ns; }

  mutable int preemptions = 0;
  int64_t step_ns = 0;

 private:
  mutable int64_t now_ns_ = kWatchSecondNs;
};

TEST(ClockWatchTest, APreemptionBetweenTheReadingsIsNoStep) {
  PreemptedClock clock;
  ClockWatch watch;
  EXPECT_EQ(watch.Poll(clock), std::nullopt);
  for (const int preemptions : {1, 2, 3, 100}) {
    clock.preemptions = preemptions;
    EXPECT_EQ(watch.Poll(clock), std::nullopt) << preemptions;
    clock.preemptions = 0;
    EXPECT_EQ(watch.Poll(clock), std::nullopt) << preemptions;
  }
}

TEST(ClockWatchTest, AStepDuringPreemptionsIsFoundAfterThem) {
  PreemptedClock clock;
  ClockWatch watch;
  watch.Poll(clock);
  clock.step_ns = -3 * kWatchSecondNs;
  clock.preemptions = 100;
  EXPECT_EQ(watch.Poll(clock), std::nullopt);
  clock.preemptions = 0;
  EXPECT_EQ(watch.Poll(clock), -3 * kWatchSecondNs);
  EXPECT_EQ(watch.Poll(clock), std::nullopt);
}

}  // namespace
}  // namespace taclink::server
