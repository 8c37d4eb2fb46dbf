#include "server/link/link_outlet.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <optional>

#include "server/events/link_watch.h"
#include "tests/server/support.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int64_t kOutletMs = 1'000'000;

class LinkOutletTest : public ::testing::Test {
 protected:
  void Make(std::optional<AgeLimit> limit) {
    outlet_ = std::make_unique<LinkOutlet>(0, hub_, clock_, limit);
    life_ = outlet_->NewLife();
  }
  // What subscribers get of a frame of a source with this period that was exposed `age_ms` ago.
  LinkState Published(int64_t age_ms, int64_t period_ms = 0, LinkStatus status = LinkStatus::kOk,
                      bool replayed = false) {
    StereoFrame frame;
    frame.sequence = ++sequence_;
    frame.period_ns = period_ms * kOutletMs;
    frame.times.exposure_monotonic_ns = clock_.MonotonicNs() - age_ms * kOutletMs;
    auto state = outlet_->Acquire();
    *state = LinkState();
    state->sequence = frame.sequence;
    state->times = frame.times;
    state->status = status;
    state->replayed = replayed;
    state->contacts.resize(1);
    state->forces.converged = true;
    if (status == LinkStatus::kDegraded) {
      state->reasons = {{ReasonId::kDrift, "it drifts"}};
      state->status_reason = "it drifts";
    }
    EXPECT_TRUE(outlet_->PublishFrame(life_, std::move(state), frame));
    const auto publication = hub_.Latest(0);
    return publication ? publication->state() : LinkState();
  }

  ManualClock clock_;
  Hub hub_{1, [](size_t, const LinkState&, Detail) { return std::string(); }};
  std::unique_ptr<LinkOutlet> outlet_;
  uint64_t life_ = 0, sequence_ = 0;
};

TEST_F(LinkOutletTest, AnOldFrameIsNeverOk) {
  Make(AgeLimit{});
  clock_.Advance(std::chrono::seconds(60));
  EXPECT_EQ(Published(200).status, LinkStatus::kOk);
  const LinkState late = Published(17'250);
  EXPECT_EQ(late.status, LinkStatus::kDegraded);
  ASSERT_EQ(late.reasons.size(), 1U);
  EXPECT_EQ(late.reasons[0].id, ReasonId::kLateFrame);
  EXPECT_EQ(late.reasons[0].value, 17.25);
  EXPECT_EQ(late.reasons[0].limit, 0.2);
  EXPECT_EQ(late.status_reason, late.reasons[0].text);
  EXPECT_THAT(late.status_reason, HasSubstr("17.250 s"));
  EXPECT_THAT(late.status_reason, HasSubstr("0.200 s"));
  EXPECT_TRUE(late.has_forces()) << "what was measured stays readable";
  EXPECT_EQ(late.contacts.size(), 1U);
  EXPECT_EQ(late.times.published_ns - late.times.exposure_monotonic_ns, 17'250 * kOutletMs);
  EXPECT_EQ(Published(1).status, LinkStatus::kOk);
}

TEST_F(LinkOutletTest, TheLimitIsTheConfiguredOneOrThreeFramePeriods) {
  clock_.Advance(std::chrono::seconds(60));
  Make(AgeLimit{});
  EXPECT_EQ(Published(201, 33).status, LinkStatus::kDegraded) << "at least 0.2 s";
  EXPECT_EQ(Published(600, 200).status, LinkStatus::kOk);
  EXPECT_EQ(Published(601, 200).status, LinkStatus::kDegraded);
  Make(AgeLimit{milliseconds(50)});
  EXPECT_EQ(Published(50, 200).status, LinkStatus::kOk);
  EXPECT_EQ(Published(51, 200).status, LinkStatus::kDegraded);
  Make(std::nullopt);
  EXPECT_EQ(Published(50'000, 33).status, LinkStatus::kOk);
}

TEST_F(LinkOutletTest, AgeMakesAStatusOnlyWorse) {
  Make(AgeLimit{});
  clock_.Advance(std::chrono::seconds(60));
  const LinkState degraded = Published(1000, 0, LinkStatus::kDegraded);
  EXPECT_EQ(degraded.status, LinkStatus::kDegraded);
  EXPECT_EQ(degraded.status_reason, "it drifts");
  ASSERT_EQ(degraded.reasons.size(), 2U);
  EXPECT_EQ(degraded.reasons[1].id, ReasonId::kLateFrame);
  for (const LinkStatus status : {LinkStatus::kStarting, LinkStatus::kCalibrating, LinkStatus::kLost}) {
    const LinkState state = Published(1000, 0, status);
    EXPECT_EQ(state.status, status);
    EXPECT_THAT(state.reasons, IsEmpty());
  }
}

TEST_F(LinkOutletTest, FramesOfALogHaveTheAgeThatTheyHadThen) {
  Make(AgeLimit{});
  clock_.Advance(std::chrono::seconds(60));
  EXPECT_EQ(Published(30'000, 0, LinkStatus::kOk, true).status, LinkStatus::kOk);
}

// The status goes to degraded once and back once, whatever the ages are in between.
TEST_F(LinkOutletTest, LateFramesDoNotFloodTheEvents) {
  Make(AgeLimit{});
  LinkWatch watch(0, {}, {}, {});
  std::vector<Event> events;
  const auto take = [&](int64_t age_ms) {
    clock_.Advance(milliseconds(33));
    watch.Take(Published(age_ms), events);
  };
  clock_.Advance(std::chrono::seconds(60));
  for (int i = 0; i < 30; ++i) take(10);
  events.clear();
  for (int i = 0; i < 100; ++i) take(i % 3 == 0 ? 20 : 300 + 7 * i);
  EXPECT_EQ(events.size(), 1U);
  for (int i = 0; i < 30; ++i) take(10);
  ASSERT_EQ(events.size(), 2U);
  EXPECT_EQ(std::get<StatusDetail>(events[0].detail).status, LinkStatus::kDegraded);
  EXPECT_EQ(std::get<StatusDetail>(events[1].detail).status, LinkStatus::kOk);
}

}  // namespace
}  // namespace taclink::server
