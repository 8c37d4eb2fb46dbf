// A link whose frames come from a log, with a clock that sleeping moves.
#include "server/replay/replay_link.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/link/link_worker.h"
#include "tests/server/replay/test_log.h"
#include "tests/server/support.h"
#include "tests/server/test_state.h"
#include "wire/frame_codec.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

constexpr int64_t kThen = 77'000'000'000;  // monotonic, when the log was made
constexpr int64_t kLatency = 8 * kMs;      // of each of its frames

/// Frame i, from 1 on, was published at kT0 + (i - 1) * 10 ms; frames from `hole` on 5 s later.
std::shared_ptr<const mcap::Reader> MakeLog(uint64_t frames, uint64_t hole = 1000) {
  mcap::BufferSink sink;
  auto writer = wire::log::LogWriter::Create(sink, {.chunk_bytes = 100'000});
  for (uint64_t i = 1; i <= frames; ++i) {
    const int64_t at = static_cast<int64_t>(i - 1) * 10 * kMs + (i >= hole ? 5000 * kMs : 0);
    LinkState state;
    FillTestState(0, i, state);
    state.times = {.exposure_monotonic_ns = kThen + at - kLatency,
                   .exposure_utc_ns = kT0 + at - kLatency,
                   .received_ns = kThen + at - kLatency + kMs,
                   .tracked_ns = 0,
                   .solved_ns = kThen + at - kMs,
                   .published_ns = kThen + at};
    const auto bytes = std::make_shared<const std::string>(wire::EncodeFrame({"a", 3}, state, Detail::kFull));
    EXPECT_TRUE((*writer)
                    ->Write({.kind = wire::log::TopicKind::kFrame, .link = "a"}, *v1::LinkFrame::descriptor(),
                            bytes, {.log_utc_ns = kT0 + at, .sequence = i})
                    .ok());
  }
  EXPECT_TRUE((*writer)->mcap().Close().ok());
  return Open(sink.bytes());
}

class ReplayLinkTest : public ::testing::Test {
 protected:
  ReplayLinkTest() { clock_.LetSleepingPassTime(); }

  std::unique_ptr<FrameSource> Source(std::shared_ptr<const mcap::Reader> log) {
    const auto& statistics = log->statistics();
    schedule_ = std::make_shared<ReplaySchedule>(static_cast<int64_t>(statistics.message_start_ns),
                                                 static_cast<int64_t>(statistics.message_end_ns), clock_);
    link_ = {.log = std::move(log), .log_name = "test.mcap", .link = "a", .schedule = schedule_};
    return Started();
  }
  std::unique_ptr<FrameSource> Started() {
    auto source = MakeReplaySource(link_, clock_);
    const auto started = source->Start();
    EXPECT_TRUE(started.ok()) << started.error().message;
    return source;
  }
  LinkState Next(FrameSource& source) {
    while (true) {
      const auto next = source.Next(frame_, milliseconds(100));
      if (!next && next.error().code == ErrorCode::kTimeout) continue;
      EXPECT_TRUE(next.ok()) << next.error().message;
      LinkState state;
      MakeReplayProcessor()->Process(frame_, state);
      return state;
    }
  }

  ManualClock clock_;
  std::shared_ptr<ReplaySchedule> schedule_;
  ReplayLink link_;
  StereoFrame frame_;
};

TEST_F(ReplayLinkTest, FramesComeAtTheirPaceAndKeepWhatTheyAre) {
  const auto source = Source(MakeLog(50));
  const int64_t begin = clock_.MonotonicNs();
  for (uint64_t i = 1; i <= 50; ++i) {
    const LinkState state = Next(*source);
    const int64_t due = begin + static_cast<int64_t>(i - 1) * 10 * kMs;
    EXPECT_EQ(clock_.MonotonicNs(), due);
    LinkState expected;
    FillTestState(0, i, expected);
    EXPECT_EQ(state.sequence, i);
    EXPECT_TRUE(state.replayed);
    EXPECT_EQ(state.status, LinkStatus::kOk);
    EXPECT_NEAR((state.shape.positions_mm[9] - expected.shape.positions_mm[9]).norm(), 0, 1e-4);
    EXPECT_EQ(state.contacts.at(0).id, expected.contacts.at(0).id);
    EXPECT_EQ(state.times.exposure_utc_ns, kT0 + static_cast<int64_t>(i - 1) * 10 * kMs - kLatency)
        << "of then";
    EXPECT_EQ(state.times.exposure_monotonic_ns, due - kLatency) << "of now";
    EXPECT_EQ(state.times.received_ns, due - kLatency + kMs);
    EXPECT_EQ(state.times.tracked_ns, 0) << "had not happened";
    EXPECT_EQ(frame_.times.exposure_monotonic_ns, due - kLatency);
    const auto again = wire::DecodeFrame(wire::EncodeFrame({"b", 0}, state, Detail::kContacts));
    EXPECT_TRUE(again->state.replayed);
  }
}

TEST_F(ReplayLinkTest, AfterItsEndTheLogBeginsAnew) {
  const auto source = Source(MakeLog(200));
  for (int round = 0; round < 3; ++round) {
    int64_t last = 0;
    for (uint64_t i = 1; i <= 200; ++i) {
      const LinkState state = Next(*source);
      EXPECT_EQ(state.sequence, i);
      EXPECT_GT(state.times.exposure_monotonic_ns, last) << "time goes on";
      last = state.times.exposure_monotonic_ns;
    }
  }
}

TEST_F(ReplayLinkTest, WhereTheLogHasNoFramesThatIsSaid) {
  const auto source = Source(MakeLog(4, 3));
  EXPECT_EQ(Next(*source).sequence, 1u);
  EXPECT_EQ(Next(*source).sequence, 2u);
  for (int i = 0; i < 3; ++i) {
    const LinkState state = Next(*source);
    EXPECT_EQ(state.status, LinkStatus::kLost);
    EXPECT_THAT(state.status_reason, HasSubstr("no frames"));
    EXPECT_EQ(state.sequence, 2u);
    EXPECT_FALSE(state.measured());
  }
  EXPECT_EQ(Next(*source).sequence, 3u);
}

TEST_F(ReplayLinkTest, WhoIsLateGoesOnWithTheNewest) {
  const auto source = Source(MakeLog(200));
  Next(*source);
  clock_.Advance(milliseconds(1005));
  EXPECT_EQ(Next(*source).sequence, 101u);
  EXPECT_EQ(Next(*source).sequence, 102u);
  clock_.Advance(milliseconds(100));
  EXPECT_EQ(Next(*source).sequence, 103u) << "a little late is caught up with";
}

TEST_F(ReplayLinkTest, AFreshSourceGoesOnWhereTheOthersAre) {
  const auto first = Source(MakeLog(200));
  Next(*first);
  clock_.Advance(milliseconds(1005));
  const auto second = Started();
  EXPECT_EQ(Next(*second).sequence, 101u);
  EXPECT_EQ(Next(*first).sequence, 101u);
}

TEST_F(ReplayLinkTest, NothingCanBeDoneToTheLink) {
  const auto processor = MakeReplayProcessor();
  EXPECT_EQ(processor->BeginTare({}).error().code, ErrorCode::kFailedPrecondition);
  const auto refused = processor->BeginCalibration({});
  EXPECT_EQ(refused.error().code, ErrorCode::kFailedPrecondition);
  EXPECT_THAT(refused.error().message, HasSubstr("plays a log"));
}

TEST_F(ReplayLinkTest, AWorkerPublishesItLikeAnyLink) {
  auto source = Source(MakeLog(100));
  Hub hub(1, [](size_t, const LinkState&, Detail) { return std::string(); });
  Receiver receiver(hub);
  auto outlet = std::make_shared<LinkOutlet>(0, hub, clock_);
  LinkWorker worker("a", MakeReplaySource(link_, clock_), MakeReplayProcessor(), outlet, clock_);
  worker.Start();
  for (int frames = 0; frames < 20;) {
    const auto publication = receiver.Next();
    ASSERT_TRUE(publication);
    if (publication->state().times.exposure_utc_ns == 0) continue;  // before the first frame
    ++frames;
    EXPECT_TRUE(publication->state().replayed);
    EXPECT_EQ(publication->state().status, LinkStatus::kOk);
  }
  worker.Stop();
  const LinkStatistics statistics = outlet->Statistics();
  EXPECT_GE(statistics.frames, 20u);
  EXPECT_EQ(statistics.latency_p99_ms, 0) << "not this server's";
  EXPECT_EQ(outlet->histograms().latency.Read().total(), 0u);
}

}  // namespace
}  // namespace taclink::server
