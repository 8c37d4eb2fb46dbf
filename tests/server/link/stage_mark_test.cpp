#include "server/link/stage_mark.h"

#include <gtest/gtest.h>

#include <limits>
#include <thread>

#include "tests/server/support.h"

namespace taclink::server {
namespace {

TEST(StageMark, KeepsStageAndTimeOfAHundredYears) {
  StageMark mark;
  const int64_t century_ns = 100LL * 365 * 86'400 * 1'000'000'000;
  mark.Begin(WorkStage::kPublish, century_ns);
  EXPECT_EQ(mark.Read().stage, WorkStage::kPublish);
  EXPECT_EQ(mark.Read().since_ns, century_ns);
}

TEST(StageMark, StageAndTimeBelongTogether) {
  StageMark mark;
  mark.Begin(WorkStage::kWait, 0);
  std::jthread writer([&](const std::stop_token& stop) {
    for (int64_t i = 0; !stop.stop_requested(); ++i)
      mark.Begin(static_cast<WorkStage>(i % static_cast<int64_t>(kWorkStageCount)), i * 1000);
  });
  for (int i = 0; i < 100'000; ++i) {
    const auto [stage, since_ns] = mark.Read();
    ASSERT_EQ(static_cast<int64_t>(stage), since_ns / 1000 % static_cast<int64_t>(kWorkStageCount));
  }
}

TEST(StageMark, AScopeEndsInWaiting) {
  ManualClock clock;
  StageMark mark;
  {
    const StageScope scope(&mark, WorkStage::kSourceStart, clock);
    EXPECT_EQ(mark.Read().stage, WorkStage::kSourceStart);
    clock.Advance(std::chrono::seconds(2));
  }
  EXPECT_EQ(mark.Read().stage, WorkStage::kWait);
  EXPECT_EQ(mark.Read().since_ns, clock.MonotonicNs());
  const StageScope unwatched(nullptr, WorkStage::kFrame, clock);
}

}  // namespace
}  // namespace taclink::server
