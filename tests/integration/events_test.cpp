// Tare, thresholds and events over gRPC.
#include <gmock/gmock.h>

#include <thread>

#include "tests/integration/support.h"
#include "wire/enum_names.h"

namespace taclink::server {
namespace {

using std::chrono::seconds;
using ::testing::HasSubstr;

class EventsTest : public ::testing::Test {
 protected:
  void TearDown() override { server_.arm().Stop(); }

  std::unique_ptr<client::EventReader> Events(const v1::StreamEventsRequest& request) {
    auto reader = client_.StreamEvents(request);
    EXPECT_TRUE(reader.ok()) << reader.error().message;
    return reader.ok() ? std::move(*reader) : nullptr;
  }
  static v1::Event Next(client::EventReader& reader) {
    auto event = reader.Next(kForever);
    EXPECT_TRUE(event.ok()) << event.error().message;
    return event.ok() ? *event : v1::Event{};
  }
  /// Resumes after what `status` says.
  static v1::StreamEventsRequest After(const std::string& run_id, uint64_t sequence) {
    v1::StreamEventsRequest request;
    request.set_run_id(run_id);
    request.set_after_sequence(sequence);
    return request;
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
  const auto reader = Events(EventsOf({v1::EVENT_KIND_CONTACT_BEGIN}));
  ASSERT_NE(reader, nullptr);
  server_.Publish(1, 5, 77);
  const v1::Event event = Next(*reader);
  EXPECT_EQ(event.kind(), v1::EVENT_KIND_CONTACT_BEGIN);
  EXPECT_EQ(event.link(), "lower");
  EXPECT_EQ(event.frame_sequence(), 5u);
  EXPECT_EQ(event.times().published_ns(), 77);
  EXPECT_EQ(event.contact().contact_id(), 7u);
  EXPECT_DOUBLE_EQ(client::Norm(event.contact().force_n()), 0.5);
  EXPECT_DOUBLE_EQ(event.contact().center_m().z(), 0.005);
  EXPECT_GT(event.times().raised_ns(), 0);
  EXPECT_GT(event.times().sent_utc_ns(), 0);
  server_.arm().events().Stop();
}

TEST_F(EventsTest, WhoComesBackMissesNothing) {
  server_.arm().events().Start();
  v1::EventStreamStatus place;
  {
    const auto reader = Events({});
    ASSERT_NE(reader, nullptr);
    Raise(3);
    for (int i = 1; i <= 2; ++i) EXPECT_EQ(Next(*reader).operation().outcome(), std::to_string(i));
    place = reader->status();
  }  // gone with one event not taken
  Raise(3);
  const auto reader = Events(After(place.run_id(), place.position()));
  ASSERT_NE(reader, nullptr);
  for (int i = 3; i <= 6; ++i) EXPECT_EQ(Next(*reader).operation().outcome(), std::to_string(i));
  EXPECT_EQ(reader->status().events_lost(), 0u);
  EXPECT_FALSE(reader->status().run_changed());
}

TEST_F(EventsTest, ARestartedServerSaysThatItIsAnother) {
  server_.arm().events().Start();
  const auto first = Events({});
  Raise(2);
  Next(*first);
  Next(*first);
  const auto reader = Events(After("another run", 1));
  ASSERT_NE(reader, nullptr);
  EXPECT_TRUE(reader->status().run_changed());
  EXPECT_EQ(Next(*reader).operation().outcome(), "1") << "all that this run has";
  const auto ahead = client_.StreamEvents(After(first->status().run_id(), 99));
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
  const v1::EventStreamStatus place = first->status();
  // In pieces, as only so many may wait for the engine.
  for (int i = 0; i < capacity + 7;) {
    const int piece = std::min(500, capacity + 7 - i);
    Raise(piece);
    i += piece;
    while (server_.arm().events().history().newest() < static_cast<uint64_t>(i) + 1)
      std::this_thread::yield();
  }
  const auto reader = Events(After(place.run_id(), place.position()));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->status().events_lost(), 7u) << "in the first message";
  EXPECT_EQ(Next(*reader).sequence(), 9u);
}

TEST_F(EventsTest, EachSecondTheNewestNumberComes) {
  server_.arm().events().Start();
  const auto reader = Events(EventsOf({v1::EVENT_KIND_DRIFT}));
  ASSERT_NE(reader, nullptr);
  Raise(4);
  while (reader->status().position() < 4) {
    server_.clock().Advance(seconds(1));
    EXPECT_EQ(reader->Next(std::chrono::milliseconds(20)).error().code, ErrorCode::kTimeout);
  }
  EXPECT_EQ(reader->status().newest_sequence(), 4u) << "also without events of its kind";
}

TEST_F(EventsTest, ThresholdsAreSetSeenAndTold) {
  server_.arm().events().Start();
  const auto reader = Events(EventsOf({v1::EVENT_KIND_THRESHOLDS, v1::EVENT_KIND_FORCE_LEVEL}));
  const auto set = client_.SetThresholds("upper", "", MakeThresholds(0.4, 0.9, 0.1));
  ASSERT_TRUE(set.ok()) << set.error().message;
  EXPECT_EQ(set->thresholds().alarm_n(), 0.9);
  const v1::Event told = Next(*reader);
  EXPECT_EQ(told.kind(), v1::EVENT_KIND_THRESHOLDS);
  EXPECT_EQ(told.link(), "upper");
  EXPECT_THAT(told.operation().who(), HasSubstr("127.0.0.1"));
  EXPECT_EQ(told.operation().values().at("warning_n"), 0.4);
  server_.Publish(0, 5);  // 0.5 N
  const v1::Event level = Next(*reader);
  EXPECT_EQ(level.kind(), v1::EVENT_KIND_FORCE_LEVEL);
  EXPECT_EQ(level.force_level().level(), v1::FORCE_LEVEL_WARNING);
  const auto arm = client_.GetArm();
  ASSERT_EQ(arm->links(0).force_levels_size(), 1);
  EXPECT_EQ(arm->links(0).force_levels(0).level(), v1::FORCE_LEVEL_WARNING);
  EXPECT_EQ(arm->links(0).force_levels(0).thresholds().warning_n(), 0.4);
  EXPECT_EQ(client_.SetThresholds("upper", "palm", {}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(client_.SetThresholds("elbow", "", {}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(client_.SetThresholds("upper", "", MakeThresholds(-1)).error().code, ErrorCode::kInvalidArgument);
}

TEST_F(EventsTest, EachLinkAnswersForItself) {
  server_.arm().Start();
  const auto reader = Events(EventsOf({v1::EVENT_KIND_TARE}));
  std::atomic<bool> done = false;
  std::thread pictures([&] {
    for (uint64_t i = 1; !done; ++i) {
      for (const size_t link : {0, 1}) {
        server_.script(link).Push(i);
        server_.script(link).WaitUntilTaken();
      }
    }
  });
  v1::TareRequest forced, elbow, long_mean;
  forced.set_force(true);
  forced.set_frames(4);
  elbow.add_links("elbow");
  long_mean.set_frames(301);
  const auto tares = client_.Tare(forced);
  const auto unknown = client_.Tare(elbow);
  const auto many = client_.Tare(long_mean);
  done = true;
  pictures.join();
  ASSERT_TRUE(tares.ok()) << tares.error().message;
  ASSERT_EQ(tares->links_size(), 2);
  EXPECT_EQ(tares->links(0).link(), "upper");
  EXPECT_EQ(tares->links(1).link(), "lower");
  EXPECT_TRUE(tares->links(1).accepted());
  EXPECT_TRUE(tares->links(1).forced());
  EXPECT_EQ(tares->links(1).frames(), 4u);
  EXPECT_DOUBLE_EQ(tares->links(1).shift_m(), 0.000125);
  EXPECT_EQ(unknown.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(many.error().code, ErrorCode::kInvalidArgument);
  const v1::Event told = Next(*reader);
  EXPECT_TRUE(told.operation().accepted());
  EXPECT_EQ(told.operation().values().at("frames"), 4);
}

TEST_F(EventsTest, ATareEndsWithTheServer) {
  server_.arm().Start();  // no pictures come: the first one waits
  std::atomic<int> under_way = 0, ended = 0;
  const auto tare = [&] {
    v1::TareRequest request;
    request.add_links("upper");
    const auto answer = client_.Tare(request, kForever);
    if (answer.ok()) {
      EXPECT_THAT(answer->links(0).reason(), HasSubstr("under way"));
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

TEST(EventKinds, AreNamedAsInTheProtocol) {
  for (size_t i = 0; i < kEventKinds; ++i)
    EXPECT_STREQ(Name(static_cast<EventKind>(i)),
                 wire::NamesOf<v1::EventKind>().Name(static_cast<int>(i) + 1));
}

}  // namespace
}  // namespace taclink::server
