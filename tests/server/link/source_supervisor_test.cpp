#include "server/link/source_supervisor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/server/support.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;
using State = SourceCondition::State;

class SupervisorTest : public ::testing::Test {
 protected:
  SupervisorTest() : supervisor_("arm", std::make_unique<FakeSource>(script_), clock_) {
    clock_.LetSleepingPassTime();
  }
  bool Step() { return supervisor_.Next(frame_, milliseconds(0)); }
  // Steps until the source was started once more; the time that passed.
  milliseconds UntilNextStart() {
    const int starts = script_->starts();
    const int64_t before = clock_.MonotonicNs();
    while (script_->starts() == starts) supervisor_.Next(frame_, milliseconds(10));
    return milliseconds((clock_.MonotonicNs() - before) / 1'000'000);
  }

  ManualClock clock_;
  const std::shared_ptr<SourceScript> script_ = std::make_shared<SourceScript>();
  SourceSupervisor supervisor_;
  StereoFrame frame_;
};

TEST_F(SupervisorTest, StartsAndDelivers) {
  EXPECT_EQ(supervisor_.condition().state, State::kStarting);
  EXPECT_FALSE(Step());
  script_->Push(5);
  EXPECT_TRUE(Step());
  EXPECT_EQ(frame_.sequence, 5u);
  EXPECT_EQ(frame_.period_ns, 1'000'000'000 / 30) << "for those who judge its age";
  const auto condition = supervisor_.condition();
  EXPECT_EQ(condition.state, State::kRunning);
  EXPECT_EQ(condition.reason, "");
  EXPECT_EQ(condition.info.description, "fake");
  EXPECT_EQ(condition.restarts, 0u);
}

TEST_F(SupervisorTest, PausesGrowToTheLongest) {
  script_->FailStarts(-1);
  EXPECT_EQ(UntilNextStart(), milliseconds(0));
  for (const int pause : {100, 200, 400, 500, 500, 500, 500})
    EXPECT_EQ(UntilNextStart(), milliseconds(pause));
  EXPECT_EQ(supervisor_.condition().state, State::kLost);
  EXPECT_THAT(supervisor_.condition().reason, HasSubstr("no camera"));
  EXPECT_EQ(supervisor_.condition().restarts, 7u);
}

TEST_F(SupervisorTest, OnlyAFrameEndsTheBackoff) {
  for (const int pause : {0, 100, 200, 400}) {
    EXPECT_EQ(UntilNextStart(), milliseconds(pause));
    script_->PushError(ErrorCode::kUnavailable, "unplugged");
    EXPECT_FALSE(Step());
  }
  EXPECT_EQ(UntilNextStart(), milliseconds(500));
  script_->Push(1);
  EXPECT_TRUE(Step());
  script_->PushError(ErrorCode::kUnavailable, "unplugged");
  EXPECT_FALSE(Step());
  EXPECT_THAT(supervisor_.condition().reason, HasSubstr("unplugged"));
  EXPECT_EQ(UntilNextStart(), milliseconds(100));
}

TEST_F(SupervisorTest, ASilentSourceIsStartedAgain) {
  EXPECT_FALSE(Step());
  clock_.Advance(milliseconds(1900));
  EXPECT_FALSE(Step());
  EXPECT_EQ(supervisor_.condition().state, State::kStarting);
  clock_.Advance(milliseconds(200));
  EXPECT_FALSE(Step());
  EXPECT_EQ(supervisor_.condition().state, State::kLost);
  EXPECT_THAT(supervisor_.condition().reason, HasSubstr("no frame for 2 s"));
  EXPECT_EQ(UntilNextStart(), milliseconds(100));
}

TEST_F(SupervisorTest, ASourceThatBeginsLaterIsWaitedFor) {
  constexpr milliseconds kLater{5000};
  SourceInfo info;
  info.begins_at_ns = clock_.MonotonicNs() + kLater.count() * 1'000'000;
  script_->Describe(info, {});
  EXPECT_FALSE(Step());
  clock_.Advance(kLater + milliseconds(1900));
  EXPECT_FALSE(Step());
  EXPECT_EQ(supervisor_.condition().state, State::kStarting);
  clock_.Advance(milliseconds(200));
  EXPECT_FALSE(Step());
  EXPECT_EQ(supervisor_.condition().state, State::kLost);
}

TEST_F(SupervisorTest, ASourceThatFallsSilentIsLostBeforeItIsStartedAgain) {
  EXPECT_FALSE(Step());
  script_->Push(1);
  EXPECT_TRUE(Step());
  clock_.Advance(milliseconds(400));
  EXPECT_FALSE(Step());
  EXPECT_EQ(supervisor_.condition().state, State::kRunning);
  clock_.Advance(milliseconds(150));
  EXPECT_FALSE(Step());
  EXPECT_EQ(supervisor_.condition().state, State::kLost);
  EXPECT_THAT(supervisor_.condition().reason, HasSubstr("silent; waiting"));
  script_->Push(2);
  EXPECT_TRUE(Step());
  EXPECT_EQ(supervisor_.condition().state, State::kRunning);
  EXPECT_EQ(script_->starts(), 1);
}

TEST_F(SupervisorTest, WhatTheSourceSaysOfItselfIsPassedOn) {
  EXPECT_FALSE(Step());
  script_->Describe({"fake", 640, 480, 30, {{"usb:1", "", "", "usb:1: unplugged"}, {"usb:2", "", "", ""}}},
                    {.pictures = {7, 8}, .info_changes = 1});
  script_->Push(1);
  EXPECT_TRUE(Step());
  const auto condition = supervisor_.condition();
  ASSERT_EQ(condition.info.cameras.size(), 2u);
  EXPECT_EQ(condition.info.cameras[0].trouble, "usb:1: unplugged");
  EXPECT_EQ(condition.counters.pictures[1], 8u);
}

TEST_F(SupervisorTest, AnEndIsNotAFailure) {
  EXPECT_FALSE(Step());
  script_->PushError(ErrorCode::kEndOfData, "12 pairs played");
  for (int i = 0; i < 20; ++i) EXPECT_FALSE(supervisor_.Next(frame_, milliseconds(1000)));
  EXPECT_EQ(script_->starts(), 1);
  EXPECT_EQ(supervisor_.condition().state, State::kEnded);
  EXPECT_THAT(supervisor_.condition().reason, HasSubstr("12 pairs played"));
}

TEST_F(SupervisorTest, AnExceptionIsAFailureLikeAnyOther) {
  EXPECT_FALSE(Step());
  script_->Push([](StereoFrame&) -> Result<void> { throw std::runtime_error("library threw"); });
  EXPECT_FALSE(Step());
  EXPECT_EQ(supervisor_.condition().state, State::kLost);
  EXPECT_THAT(supervisor_.condition().reason, HasSubstr("library threw"));
  EXPECT_EQ(UntilNextStart(), milliseconds(100));
}

}  // namespace
}  // namespace taclink::server
