// Logs whose message i is due 10 ms after message i - 1, and a clock that the test moves.
#include "server/replay/log_player.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <limits>

#include "server/replay/log_channels.h"
#include "tests/server/replay/test_log.h"

namespace taclink::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Kind = PlayerStep::Kind;

constexpr int64_t kNow = 5'000'000'000;  // of the clock, when a test begins

class Played {
 public:
  explicit Played(std::shared_ptr<const mcap::Reader> reader, PlayerOptions options = {},
                  const LogSelection& selection = {}) {
    const auto channels = ChooseChannels(*reader, selection);
    EXPECT_TRUE(channels.ok()) << channels.error().message;
    topics_ = channels->topics;
    options.channels = channels->played;
    auto player = LogPlayer::Open(std::move(reader), std::move(options));
    EXPECT_TRUE(player.ok()) << player.error().message;
    player_ = std::move(*player);
  }
  explicit Played(TestLog& log, PlayerOptions options = {}) : Played(Open(log.Bytes()), std::move(options)) {}

  LogPlayer& operator*() { return *player_; }
  LogPlayer* operator->() { return player_.get(); }

  PlayerStep Next() { return player_->Next(now_ns); }
  /// Frames and events as "a3", "e1"; what is not a message by its name. Waits are gone through.
  std::string Told() {
    PlayerStep step = Next();
    while (step.kind == Kind::kWait) {
      EXPECT_GT(*step.due_ns, now_ns);
      now_ns = *step.due_ns;
      step = Next();
    }
    return Name(step);
  }
  std::string Name(const PlayerStep& step) const {
    switch (step.kind) {
      case Kind::kMessage:
        break;
      case Kind::kWait:
        return "wait";
      case Kind::kPaused:
        return "paused";
      case Kind::kBegunAnew:
        return "again";
      case Kind::kEnded:
        return "ended";
    }
    if (topics_.at(step.channel).kind == wire::log::TopicKind::kEvents) {
      v1::Event event;
      EXPECT_TRUE(event.ParseFromArray(step.data.data(), static_cast<int>(step.data.size())));
      return "e" + std::to_string(event.sequence());
    }
    v1::LinkFrame frame;
    EXPECT_TRUE(frame.ParseFromArray(step.data.data(), static_cast<int>(step.data.size())));
    return frame.link() + std::to_string(frame.sequence());
  }
  std::vector<std::string> Told(int count) {
    std::vector<std::string> out;
    for (int i = 0; i < count; ++i) out.push_back(Told());
    return out;
  }

  int64_t now_ns = kNow;

 private:
  std::map<uint16_t, wire::log::Topic> topics_;
  std::unique_ptr<LogPlayer> player_;
};

TEST(LogPlayer, EachMessageIsDueAtItsTime) {
  TestLog log;
  Played player(log.Frames(100));
  for (int i = 0; i < 100; ++i) {
    const int64_t due = kNow + i * 10 * kMs;
    if (i > 0) {
      const PlayerStep wait = player->Next(due - 1);
      EXPECT_EQ(wait.kind, Kind::kWait);
      EXPECT_EQ(wait.due_ns, due);
    }
    const PlayerStep step = player->Next(due);
    EXPECT_EQ(player.Name(step), "a" + std::to_string(i));
    EXPECT_EQ(step.due_ns, due);
    EXPECT_EQ(step.log_utc_ns, kT0 + i * 10 * kMs);
    EXPECT_EQ(player->status().position_utc_ns, step.log_utc_ns);
  }
  EXPECT_EQ(player->Next(kNow + 990 * kMs).kind, Kind::kEnded);
  EXPECT_TRUE(player->status().ended);
  EXPECT_EQ(player->status().damaged, 0u);
}

TEST(LogPlayer, SpeedScalesTimeAndMayChange) {
  TestLog log;
  Played player(log.Frames(20), {.speed = 4});
  EXPECT_EQ(player.Told(5).back(), "a4");
  EXPECT_EQ(player.now_ns, kNow + 10 * kMs);
  // Half way to frame 5, so 5 ms of the log are left.
  player.now_ns += 1'250'000;
  ASSERT_TRUE(player->SetSpeed(0.5, player.now_ns).ok());
  EXPECT_EQ(player.Told(), "a5");
  EXPECT_EQ(player.now_ns, kNow + 10 * kMs + 1'250'000 + 10 * kMs);
  EXPECT_EQ(player.Told(), "a6");
  EXPECT_EQ(player.now_ns, kNow + 41'250'000);
  for (const double bad : {-1.0, 0.05, 101.0, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_EQ(player->SetSpeed(bad, player.now_ns).error().code, ErrorCode::kInvalidArgument);
}

TEST(LogPlayer, ALongTimeWithoutMessagesIsPlayedAsAPause) {
  constexpr int64_t kYearsNs = 56LL * 365 * 86'400 * 1'000'000'000;
  for (const size_t chunk_bytes : {size_t{100}, size_t{1} << 20}) {  // between chunks, and within one
    TestLog log({.chunk_bytes = chunk_bytes});
    log.Frames(5);
    for (uint64_t i = 5; i < 10; ++i) log.Frame("a", i, kT0 + kYearsNs + static_cast<int64_t>(i) * 10 * kMs);
    Played player(log, {.speed = 2});
    EXPECT_EQ(player.Told(5).back(), "a4");
    EXPECT_EQ(player.now_ns, kNow + 20 * kMs);
    EXPECT_EQ(player.Told(), "a5");
    EXPECT_EQ(player.now_ns, kNow + 20 * kMs + LogGaps::kPauseNs / 2);
    EXPECT_EQ(player->status().position_utc_ns, kT0 + kYearsNs + 50 * kMs);
    // Within the pause one is at its end.
    player->Seek(kT0 + 40 * kMs);
    EXPECT_EQ(player.Told(), "a3") << "the state before";
    EXPECT_EQ(player.Told(), "a4");
    player.now_ns += 100 * kMs;
    ASSERT_TRUE(player->SetSpeed(1, player.now_ns).ok());
    EXPECT_EQ(player.Told(), "a5");
    EXPECT_EQ(player.now_ns % kMs, 0);
  }
}

TEST(LogGaps, ShortSilencesAreKept) {
  TestLog log({.chunk_bytes = 100});
  log.Frame("a", 0, kT0);
  log.Frame("a", 1, kT0 + LogGaps::kLeastGapNs - 1);
  log.Frame("a", 2, kT0 + 2 * LogGaps::kLeastGapNs);
  const LogGaps gaps(*Open(log.Bytes()));
  const int64_t one = kT0 + LogGaps::kLeastGapNs - 1, two = kT0 + 2 * LogGaps::kLeastGapNs;
  EXPECT_EQ(gaps.PlayedNs(one) - gaps.PlayedNs(kT0), LogGaps::kLeastGapNs - 1);
  EXPECT_EQ(gaps.PlayedNs(two) - gaps.PlayedNs(one), LogGaps::kPauseNs);
  for (const int64_t time : {kT0, one, two, two + 5}) EXPECT_EQ(gaps.LogUtcNs(gaps.PlayedNs(time)), time);
}

TEST(LogPlayer, AtSpeed0AllIsThereAtOnce) {
  TestLog log;
  Played player(log.Frames(50), {.speed = 0});
  for (int i = 0; i < 50; ++i) {
    const PlayerStep step = player.Next();
    EXPECT_EQ(player.Name(step), "a" + std::to_string(i));
    EXPECT_FALSE(step.due_ns);
  }
  EXPECT_EQ(player.Next().kind, Kind::kEnded);
  EXPECT_EQ(player.now_ns, kNow);
}

TEST(LogPlayer, WhoComesLateGetsAllAndHearsWhenItWasDue) {
  TestLog log;
  Played player(log.Frames(10));
  player.Told();
  player.now_ns += 45 * kMs;
  for (int i = 1; i <= 4; ++i) {
    const PlayerStep step = player.Next();
    EXPECT_EQ(player.Name(step), "a" + std::to_string(i));
    EXPECT_EQ(step.due_ns, kNow + i * 10 * kMs);
  }
  EXPECT_EQ(player.Next().due_ns, kNow + 50 * kMs) << "back in time";
}

TEST(LogPlayer, TimeStandsStillWhilePaused) {
  TestLog log;
  Played player(log.Frames(10), {.paused = true});
  EXPECT_EQ(player.Told(), "paused");
  player.now_ns += 1000 * kMs;
  player->Resume();
  EXPECT_EQ(player.Told(3).back(), "a2");
  EXPECT_EQ(player.now_ns, kNow + 1020 * kMs);
  player->Pause(player.now_ns + 4 * kMs);
  EXPECT_EQ(player.Told(), "paused");
  EXPECT_TRUE(player->status().paused);
  player.now_ns += 500 * kMs;
  player->Resume();
  EXPECT_EQ(player.Told(), "a3");
  EXPECT_EQ(player.now_ns, kNow + 1526 * kMs) << "6 ms were left";
}

// A client that did not read for a while, and pauses: it is not late for good.
TEST(LogPlayer, APauseForgivesLateness) {
  TestLog log;
  Played player(log.Frames(10));
  player.Told();
  player.now_ns += 1000 * kMs;
  player->Pause(player.now_ns);
  player->Resume();
  EXPECT_THAT(player.Told(2), ElementsAre("a1", "a2"));
  EXPECT_EQ(player.now_ns, kNow + 1010 * kMs);
}

TEST(LogPlayer, OnlyTheRangeIsPlayed) {
  TestLog log;
  Played player(log.Frames(100), {.from_utc_ns = kT0 + 300 * kMs, .to_utc_ns = kT0 + 320 * kMs});
  EXPECT_THAT(player.Told(4), ElementsAre("a30", "a31", "a32", "ended"));
  EXPECT_EQ(player.now_ns, kNow + 20 * kMs);
}

TEST(LogPlayer, ARangeBetweenMessagesIsEmptyAndLasts) {
  TestLog log;
  Played player(log.Frames(100),
                {.from_utc_ns = kT0 + 301 * kMs, .to_utc_ns = kT0 + 309 * kMs, .loop = true});
  EXPECT_EQ(player.Told(), "ended") << "it would begin again for ever";
}

TEST(LogPlayer, ARangeBesideTheLogIsRefused) {
  TestLog log;
  const auto reader = Open(log.Frames(10).Bytes());
  for (const auto& [from, to] :
       {std::pair(kT0 + 1000 * kMs, int64_t{0}), std::pair(int64_t{1}, kT0 - 1),
        std::pair(kT0 + 50 * kMs, kT0 + 40 * kMs), std::pair(int64_t{-1}, int64_t{0})}) {
    const auto player = LogPlayer::Open(reader, {.from_utc_ns = from, .to_utc_ns = to});
    EXPECT_EQ(player.error().code, ErrorCode::kInvalidArgument);
  }
}

TEST(LogPlayer, ALogWithoutMessagesEndsAtOnce) {
  TestLog log;
  Played player(log, {.loop = true});
  EXPECT_EQ(player.Told(), "ended");
}

TEST(LogPlayer, TheRangeBeginsAnewInStep) {
  TestLog log;
  Played player(log.Frames(11), {.loop = true});
  for (int round = 0; round < 3; ++round) {
    if (round > 0) {
      EXPECT_EQ(player.Told(), "again");
    }
    EXPECT_EQ(player->status().loops, static_cast<uint64_t>(round));
    for (int i = 0; i < 11; ++i) {
      EXPECT_EQ(player.Told(), "a" + std::to_string(i));
      EXPECT_EQ(player.now_ns, kNow + (round * 100 + i * 10) * kMs);
    }
  }
  player->SetLoop(false);
  EXPECT_EQ(player.Told(), "ended");
}

TEST(LogPlayer, ARoundOfOneMessageDoesNotSpin) {
  TestLog log;
  Played player(log.Frames(1), {.loop = true});
  EXPECT_THAT(player.Told(4), ElementsAre("a0", "again", "a0", "again"));
  EXPECT_EQ(player.now_ns, kNow + 200 * kMs);
}

TEST(LogPlayer, ASeekShowsTheNewestFrameOfEachLinkFirst) {
  TestLog log;
  for (int i = 0; i < 100; ++i) {
    if (i == 0) log.Frame("old", 0, kT0);
    log.Frame("a", static_cast<uint64_t>(i), kT0 + i * 100 * kMs);
    if (i % 10 == 5) log.Frame("b", static_cast<uint64_t>(i), kT0 + i * 100 * kMs + 1);
    log.Event(static_cast<uint64_t>(i), kT0 + i * 100 * kMs + 2);
  }
  Played player(log);
  player.Told(3);
  player->Seek(kT0 + 5000 * kMs + 50 * kMs);
  EXPECT_EQ(player->status().position_utc_ns, kT0 + 5050 * kMs);
  const int64_t before = player.now_ns;
  EXPECT_THAT(player.Told(2), ElementsAre("b45", "a50"));
  EXPECT_EQ(player.now_ns, before);
  EXPECT_EQ(player.Told(), "a51");
  EXPECT_EQ(player.now_ns, before + 50 * kMs);
  EXPECT_EQ(player.Told(), "e51");
  player->Seek(kT0 + 200 * kMs);
  EXPECT_THAT(player.Told(3), ElementsAre("old0", "a1", "a2")) << "also backwards";
  player->Seek(0);
  EXPECT_EQ(player.Told(), "old0") << "bounded by the range";
  player->Seek(std::numeric_limits<int64_t>::max());
  EXPECT_THAT(player.Told(4), ElementsAre("b95", "a99", "e99", "ended"));
}

TEST(LogPlayer, ASeekWhilePausedShowsAPictureAndStaysPaused) {
  TestLog log;
  Played player(log.Frames(100), {.paused = true});
  player->Seek(kT0 + 505 * kMs);
  EXPECT_THAT(player.Told(2), ElementsAre("a50", "paused"));
  player->Resume();
  EXPECT_EQ(player.Told(), "a51");
}

TEST(LogPlayer, StepsAreFramesOfOneLink) {
  TestLog log;
  for (int i = 0; i < 20; ++i) {
    const auto number = static_cast<uint64_t>(i);
    log.Frame("a", number, kT0 + i * 10 * kMs);
    log.Frame("b", number, kT0 + i * 10 * kMs + 1);
    log.Event(number, kT0 + i * 10 * kMs + 2);
  }
  Played player(log, {.paused = true});
  ASSERT_TRUE(player->Step(1, player.now_ns).ok());
  EXPECT_THAT(player.Told(2), ElementsAre("a0", "paused"));
  ASSERT_TRUE(player->Step(2, player.now_ns).ok());
  EXPECT_THAT(player.Told(6), ElementsAre("b0", "e0", "a1", "b1", "paused", "paused"));
  EXPECT_EQ(player.now_ns, kNow) << "steps take no time";
  player->Resume();
  EXPECT_THAT(player.Told(2), ElementsAre("e1", "a2"));
  for (const uint32_t bad : {0u, 1001u})
    EXPECT_EQ(player->Step(bad, player.now_ns).error().code, ErrorCode::kInvalidArgument);
  ASSERT_TRUE(player->Step(1000, player.now_ns).ok());
  std::string last;
  for (std::string told = player.Told(); told != "paused"; told = player.Told()) last = told;
  EXPECT_EQ(last, "e19");
  player->Resume();
  EXPECT_EQ(player.Told(), "ended");
}

TEST(LogPlayer, WhatCannotBeReadIsCountedAndPassedOver) {
  TestLog log({.chunk_bytes = 1000});
  mcap::Buffer bytes = log.Frames(200).Bytes();
  const auto whole = Open(bytes);
  const auto& chunks = whole->chunk_indexes();
  ASSERT_GT(chunks.size(), 5u);
  const auto& hurt = chunks[2];
  bytes[static_cast<size_t>(hurt.chunk_start + hurt.chunk_length - 20)] ^= std::byte{1};
  Played player(Open(bytes), {.loop = true});
  std::vector<std::string> expected;
  for (int i = 0; i < 200; ++i) {
    const auto time = static_cast<uint64_t>(kT0 + i * 10 * kMs);
    if (time < hurt.message_start_ns || time > hurt.message_end_ns)
      expected.push_back("a" + std::to_string(i));
  }
  ASSERT_LT(expected.size(), 200u);
  for (int round = 0; round < 2; ++round) {
    EXPECT_EQ(player.Told(static_cast<int>(expected.size())), expected);
    EXPECT_EQ(player->status().damaged, 1u) << "a place, not how often it was met";
    EXPECT_EQ(player.Told(), "again");
  }
}

TEST(LogPlayer, OnlyTheLinksAskedFor) {
  TestLog log;
  log.Frame("a", 1, kT0);
  log.Frame("b", 2, kT0 + 1);
  log.Event(3, kT0 + 2);
  const auto reader = Open(log.Bytes());
  Played player(reader, {.speed = 0}, {.links = {"b"}, .events = false});
  EXPECT_THAT(player.Told(2), ElementsAre("b2", "ended"));
  EXPECT_THAT(LinksOf(*reader), ElementsAre("a", "b"));
  const auto wrong = ChooseChannels(*reader, {.links = {"nose"}});
  EXPECT_EQ(wrong.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(wrong.error().message, HasSubstr("nose"));
}

// Two links at 30 Hz for an hour: a seek reads a few chunks of the thousands, and takes as long as they do.
TEST(LogPlayer, ASeekInALongLogReadsOnlyWhatIsThere) {
  constexpr int kFrames = 30 * 3600;
  constexpr int64_t kPeriod = 1'000'000'000 / 30;
  constexpr uint64_t kChunk = uint64_t{1} << 16;
  TestLog log({.chunk_bytes = kChunk});
  for (int i = 0; i < kFrames; ++i) {
    for (const char* link : {"a", "b"}) log.Frame(link, static_cast<uint64_t>(i), kT0 + i * kPeriod, 500);
  }
  const auto source = std::make_shared<const CountingSource>(log.Bytes());
  Played player(Open(source));
  double longest_ms = 0;
  for (const int target : {kFrames / 2, 10, kFrames - 10, kFrames / 3, kFrames / 7}) {
    const uint64_t read = source->bytes_read();
    const auto begin = std::chrono::steady_clock::now();
    player->Seek(kT0 + target * kPeriod + 1);
    const std::string number = std::to_string(target);
    EXPECT_THAT(player.Told(2), ElementsAre("a" + number, "b" + number));
    EXPECT_EQ(player.Told(), "a" + std::to_string(target + 1));
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begin;
    longest_ms = std::max(longest_ms, took.count());
    EXPECT_LT(source->bytes_read() - read, 6 * kChunk);
  }
  std::printf("seek in a log of an hour, %.0f MB: at most %.2f ms\n",
              static_cast<double>(source->size()) * 1e-6, longest_ms);
}

}  // namespace
}  // namespace taclink::server
