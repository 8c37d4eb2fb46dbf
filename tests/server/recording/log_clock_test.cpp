#include "server/recording/log_clock.h"

#include <gtest/gtest.h>

#include "tests/server/support.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int64_t kMillisecondNs = 1'000'000;

TEST(LogClock, FollowsAClockThatIsSlewedAndKeepsTheTimeLineOfALog) {
  ManualClock clock;
  LogClock log(clock);
  EXPECT_EQ(log.NowUtc(), clock.UtcNs());
  // Set by less than a step: the log's times catch up by at most 0.5 ms a second.
  clock.StepUtc(milliseconds(-400));
  int64_t before_ns = log.NowUtc();
  for (int i = 0; i < 1000; ++i) {
    clock.Advance(seconds(1));
    EXPECT_EQ(log.Step(), std::nullopt);
    const int64_t passed_ns = log.NowUtc() - before_ns;
    EXPECT_GE(passed_ns, 999 * kMillisecondNs);
    EXPECT_LE(passed_ns, 1001 * kMillisecondNs);
    before_ns = log.NowUtc();
  }
  EXPECT_EQ(log.NowUtc(), clock.UtcNs());
}

TEST(LogClock, ReportsAClockThatWasSetUntilAnotherLogBegins) {
  ManualClock clock;
  LogClock log(clock);
  const int64_t before_ns = log.NowUtc();
  clock.StepUtc(std::chrono::hours(-24));
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(log.Step(), -24 * 3600 * int64_t{1'000'000'000});
    EXPECT_EQ(log.NowUtc(), before_ns) << "of this log";
  }
  log.Begin();
  EXPECT_EQ(log.Step(), std::nullopt);
  EXPECT_EQ(log.NowUtc(), clock.UtcNs());
}

}  // namespace
}  // namespace taclink::server
