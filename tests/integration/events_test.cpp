// Tare, thresholds and events over gRPC.
#include <gmock/gmock.h>

#include <thread>

#include "tests/integration/support.h"

namespace taclink::server {
namespace {

using std::chrono::seconds;
using ::testing::HasSubstr;

class EventsTest : public ::testing::Test {
 protected:
  void TearDown() override { server_.arm().Stop(); }

  std::unique_ptr<client::EventReader> Events(const client::EventOptions& options) {
    auto reader = client_.StreamEvents(options);
    EXPECT_TRUE(reader.ok()) << reader.error().message;
    return reader.ok() ? std::move(*reader) : nullptr;
  }
  static client::Event Next(client::EventReader& reader) {
    auto event = reader.Next(kForever);
    EXPECT_TRUE(event.ok()) << event.error().message;
    return event.ok() ? *event : client::Event{};
  }
  // Each makes one event.
  void Raise(int count) {
    for (int i = 0; i < count; ++i)
      server_.arm().events().Post(EventKind::kTare, 0,
                                  {.who = "test", .outcome = std::to_string(++raised_), .values = {}});
  }

  TestServer server_;
  client::Client client_ = server_.Connect();
  int raised_ = 0;
};

TEST_F(EventsTest, AContactIsToldWithItsTimes) {
  server_.arm().events().Start();
  const auto reader = Events({.kinds = {client::EventKind::kContactBegin}});
  ASSERT_NE(reader, nullptr);
  server_.Publish(1, 5, 77);
  const client::Event event = Next(*reader);
  EXPECT_EQ(event.kind, client::EventKind::kContactBegin);
  EXPECT_EQ(event.link, "lower");
  EXPECT_EQ(event.frame_sequence, 5u);
  EXPECT_EQ(event.published_ns, 77);
  EXPECT_EQ(event.contact_id, 7u);
  EXPECT_DOUBLE_EQ(event.force_n, 0.5);
  EXPECT_DOUBLE_EQ(event.center_m[2], 0.005);
  EXPECT_GT(event.raised_ns, 0);
  EXPECT_GT(event.sent_utc_ns, 0);
  EXPECT_GT(event.client_utc_ns, 0);
  server_.arm().events().Stop();
}

TEST_F(EventsTest, WhoComesBackMissesNothing) {
  server_.arm().events().Start();
  client::EventPlace place;
  {
    const auto reader = Events({});
    ASSERT_NE(reader, nullptr);
    Raise(3);
    for (int i = 1; i <= 2; ++i) EXPECT_EQ(Next(*reader).outcome, std::to_string(i));
    place = reader->place();
  }  // gone with one event not taken
  Raise(3);
  const auto reader = Events({.resume = place});
  ASSERT_NE(reader, nullptr);
  for (int i = 3; i <= 6; ++i) EXPECT_EQ(Next(*reader).outcome, std::to_string(i));
  EXPECT_EQ(reader->events_lost(), 0u);
  EXPECT_FALSE(reader->run_changed());
}

TEST_F(EventsTest, ARestartedServerSaysThatItIsAnother) {
  server_.arm().events().Start();
  const auto first = Events({});
  Raise(2);
  Next(*first);
  Next(*first);
  const auto reader = Events({.resume = client::EventPlace{"another run", 1}});
  ASSERT_NE(reader, nullptr);
  EXPECT_TRUE(reader->run_changed());
  EXPECT_EQ(Next(*reader).outcome, "1") << "all that this run has";
  const auto ahead = client_.StreamEvents({.resume = client::EventPlace{first->place().run_id, 99}});
  ASSERT_FALSE(ahead.ok());
  EXPECT_EQ(ahead.error().code, ErrorCode::kInvalidArgument);
}

TEST_F(EventsTest, AHistoryThatIsTooShortSaysHowManyAreLost) {
  server_.arm().events().Start();
  const auto first = Events({});
  const auto capacity = static_cast<int>(server_.arm().events().history().capacity());
  ASSERT_GT(capacity, 500);
  Raise(1);
  Next(*first);
  const client::EventPlace place = first->place();
  // In pieces, as only so many may wait for the engine.
  for (int i = 0; i < capacity + 7;) {
    const int piece = std::min(500, capacity + 7 - i);
    Raise(piece);
    i += piece;
    while (server_.arm().events().history().newest() < static_cast<uint64_t>(i) + 1)
      std::this_thread::yield();
  }
  const auto reader = Events({.resume = place});
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->events_lost(), 7u) << "in the first message";
  EXPECT_EQ(Next(*reader).sequence, 9u);
}

TEST_F(EventsTest, EachSecondTheNewestNumberComes) {
  server_.arm().events().Start();
  const auto reader = Events({.kinds = {client::EventKind::kDrift}});
  ASSERT_NE(reader, nullptr);
  Raise(4);
  while (reader->place().after_sequence < 4) {
    server_.clock().Advance(seconds(1));
    EXPECT_EQ(reader->Next(std::chrono::milliseconds(20)).error().code, ErrorCode::kTimeout);
  }
  EXPECT_EQ(reader->newest_sequence(), 4u) << "also without events of its kind";
}

TEST_F(EventsTest, ThresholdsAreSetSeenAndTold) {
  server_.arm().events().Start();
  const auto reader = Events({.kinds = {client::EventKind::kThresholds, client::EventKind::kForceLevel}});
  const auto set =
      client_.SetThresholds("upper", "", {.warning_n = 0.4, .alarm_n = 0.9, .hysteresis_n = 0.1});
  ASSERT_TRUE(set.ok()) << set.error().message;
  EXPECT_EQ(set->thresholds.alarm_n, 0.9);
  const client::Event told = Next(*reader);
  EXPECT_EQ(told.kind, client::EventKind::kThresholds);
  EXPECT_EQ(told.link, "upper");
  EXPECT_THAT(told.who, HasSubstr("127.0.0.1"));
  EXPECT_EQ(told.values.at("warning_n"), 0.4);
  server_.Publish(0, 5);  // 0.5 N
  const client::Event level = Next(*reader);
  EXPECT_EQ(level.kind, client::EventKind::kForceLevel);
  EXPECT_EQ(level.level, client::ForceLevel::kWarning);
  const auto arm = client_.GetArm();
  ASSERT_EQ(arm->links[0].force_levels.size(), 1u);
  EXPECT_EQ(arm->links[0].force_levels[0].level, client::ForceLevel::kWarning);
  EXPECT_EQ(arm->links[0].force_levels[0].thresholds.warning_n, 0.4);
  EXPECT_EQ(client_.SetThresholds("upper", "palm", {}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(client_.SetThresholds("elbow", "", {}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(client_.SetThresholds("upper", "", {.warning_n = -1}).error().code, ErrorCode::kInvalidArgument);
}

TEST_F(EventsTest, EachLinkAnswersForItself) {
  server_.arm().Start();
  const auto reader = Events({.kinds = {client::EventKind::kTare}});
  std::atomic<bool> done = false;
  std::thread pictures([&] {
    for (uint64_t i = 1; !done; ++i) {
      for (const size_t link : {0, 1}) {
        server_.script(link).Push(i);
        server_.script(link).WaitUntilTaken();
      }
    }
  });
  const auto tares = client_.Tare({.force = true, .frames = 4});
  const auto unknown = client_.Tare({.links = {"elbow"}});
  const auto many = client_.Tare({.frames = 301});
  done = true;
  pictures.join();
  ASSERT_TRUE(tares.ok()) << tares.error().message;
  ASSERT_EQ(tares->size(), 2u);
  EXPECT_EQ((*tares)[0].link, "upper");
  EXPECT_EQ((*tares)[1].link, "lower");
  EXPECT_TRUE((*tares)[1].accepted);
  EXPECT_TRUE((*tares)[1].forced);
  EXPECT_EQ((*tares)[1].frames, 4);
  EXPECT_DOUBLE_EQ((*tares)[1].shift_m, 0.000125);
  EXPECT_EQ(unknown.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(many.error().code, ErrorCode::kInvalidArgument);
  const client::Event told = Next(*reader);
  EXPECT_TRUE(told.accepted);
  EXPECT_EQ(told.values.at("frames"), 4);
}

TEST_F(EventsTest, ATareEndsWithTheServer) {
  server_.arm().Start();  // no pictures come: the first one waits
  std::atomic<int> under_way = 0, ended = 0;
  const auto tare = [&] {
    const auto answer = client_.Tare({.links = {"upper"}}, kForever);
    if (answer.ok()) {
      EXPECT_THAT(answer->front().reason, HasSubstr("under way"));
      ++under_way;
    } else {
      EXPECT_EQ(answer.error().code, ErrorCode::kUnavailable);
      EXPECT_THAT(answer.error().message, HasSubstr("shutting down"));
      ++ended;
    }
  };
  std::thread first(tare), second(tare);
  while (under_way + ended == 0) std::this_thread::yield();  // so the other one waits
  server_.Stop();
  first.join();
  second.join();
  EXPECT_EQ(under_way, 1);
  EXPECT_EQ(ended, 1);
}

}  // namespace
}  // namespace taclink::server
