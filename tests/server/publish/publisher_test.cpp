// What links publish arrives in JetStream, whatever happens to the NATS server.
#include "server/publish/publisher.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <fstream>
#include <functional>
#include <set>

#include "taclink/v1/events.pb.h"
#include "taclink/v1/frame.pb.h"
#include "tests/integration/support.h"
#include "tests/server/publish/nats_server.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using ::testing::AllOf;
using ::testing::ElementsAreArray;
using ::testing::HasSubstr;
using testing::NatsServer;
using testing::ReadStream;
using testing::Stored;

constexpr milliseconds kLimit{30'000};

class PublisherTest : public ::testing::Test {
 protected:
  void Start(const std::string& url, PublishConfig config = {}) {
    config.url = url;
    config.site = "lab";
    config.stream = "TACLINK_lab";
    config.frames_rate_hz = 1000;
    config.contacts_deadband_n = 0;
    server_.arm().events().Start();
    auto publisher = Publisher::Start(server_.arm(), config);
    ASSERT_TRUE(publisher.ok()) << publisher.error().message;
    publisher_ = std::move(*publisher);
  }
  /// Time goes on until `done`.
  bool Wait(const std::function<bool(const PublishStatus&)>& done) {
    const auto give_up = std::chrono::steady_clock::now() + kForever;
    while (!done(publisher_->Status())) {
      if (std::chrono::steady_clock::now() > give_up) return false;
      server_.clock().Advance(milliseconds(10));
      std::this_thread::sleep_for(milliseconds(1));
    }
    return true;
  }
  bool WaitUntilAcknowledged(uint64_t count) {
    return Wait([count](const PublishStatus& status) { return status.outbox.acknowledged >= count; });
  }
  void PublishFrame(uint64_t sequence) {
    server_.clock().Advance(milliseconds(20));
    server_.Publish(sequence % 2, sequence, server_.clock().MonotonicNs());
  }
  void RaiseEvent(double warning_n) {
    ASSERT_TRUE(server_.Connect().SetThresholds("upper", "", MakeThresholds(warning_n)).ok());
  }

  TestServer server_;
  std::unique_ptr<Publisher> publisher_;
};

std::vector<double> WarningsOf(const std::vector<Stored>& all) {
  std::vector<double> out;
  for (const Stored& stored : all) {
    v1::Event event;
    if (!stored.subject.ends_with(".event") || !event.ParseFromString(stored.bytes)) continue;
    if (event.kind() == v1::EVENT_KIND_THRESHOLDS) out.push_back(event.operation().values().at("warning_n"));
  }
  return out;
}

std::vector<uint64_t> SequencesOf(const std::vector<Stored>& all, const std::string& subject) {
  std::vector<uint64_t> out;
  for (const Stored& stored : all) {
    v1::LinkFrame frame;
    if (stored.subject == subject && frame.ParseFromString(stored.bytes)) out.push_back(frame.sequence());
  }
  return out;
}

size_t CountOf(const std::vector<Stored>& all, const std::string& kind) {
  return static_cast<size_t>(std::count_if(
      all.begin(), all.end(), [&](const Stored& stored) { return stored.subject.ends_with("." + kind); }));
}

TEST_F(PublisherTest, FramesContactsAndEventsArrive) {
  NatsServer nats;
  Start(nats.url());
  for (uint64_t i = 1; i <= 6; ++i) PublishFrame(i);
  RaiseEvent(3);
  ASSERT_TRUE(WaitUntilAcknowledged(13));
  const auto all = ReadStream(nats.url(), "TACLINK_lab", [](const std::vector<Stored>& read) {
    return CountOf(read, "frame") == 6 && CountOf(read, "contacts") == 6 && WarningsOf(read).size() == 1;
  });
  EXPECT_THAT(SequencesOf(all, "taclink.lab.test.lower.frame"), ElementsAreArray({1, 3, 5}));
  EXPECT_THAT(SequencesOf(all, "taclink.lab.test.upper.frame"), ElementsAreArray({2, 4, 6}));
  EXPECT_THAT(SequencesOf(all, "taclink.lab.test.upper.contacts"), ElementsAreArray({2, 4, 6}));
  EXPECT_THAT(WarningsOf(all), ElementsAreArray({3.0}));
  // The bytes are those of the API.
  const auto frame = std::find_if(
      all.begin(), all.end(), [](const Stored& s) { return s.subject == "taclink.lab.test.lower.frame"; });
  ASSERT_NE(frame, all.end());
  v1::LinkFrame message;
  ASSERT_TRUE(message.ParseFromString(frame->bytes));
  EXPECT_EQ(message.link(), "lower");
  EXPECT_GT(message.positions_m_size(), 0);
}

TEST_F(PublisherTest, NothingIsLostOrDoubledWhileNatsIsAway) {
  NatsServer nats;
  Start(nats.url());
  uint64_t sequence = 0;
  RaiseEvent(1);
  while (sequence < 10) PublishFrame(++sequence);
  ASSERT_TRUE(WaitUntilAcknowledged(5));
  while (sequence < 40) PublishFrame(++sequence);  // some of them may be under way
  nats.Kill();
  ASSERT_TRUE(Wait([](const PublishStatus& status) { return !status.connected; }));
  EXPECT_THAT(publisher_->Status().trouble, HasSubstr("no NATS server at " + nats.url()));
  RaiseEvent(2);
  while (sequence < 60) PublishFrame(++sequence);
  RaiseEvent(3);
  nats.Start();
  const uint64_t everything = 60 + 60 + 3;
  ASSERT_TRUE(WaitUntilAcknowledged(everything));
  const auto all = ReadStream(nats.url(), "TACLINK_lab", [](const std::vector<Stored>& read) {
    return CountOf(read, "frame") >= 60 && CountOf(read, "contacts") >= 60 && WarningsOf(read).size() >= 3;
  });
  for (const std::string kind : {"frame", "contacts"}) {
    std::vector<uint64_t> sequences = SequencesOf(all, "taclink.lab.test.lower." + kind);
    const auto upper = SequencesOf(all, "taclink.lab.test.upper." + kind);
    sequences.insert(sequences.end(), upper.begin(), upper.end());
    EXPECT_EQ(sequences.size(), 60U) << kind;
    EXPECT_EQ(std::set<uint64_t>(sequences.begin(), sequences.end()).size(), 60U) << kind;
  }
  EXPECT_THAT(WarningsOf(all), ElementsAreArray({1.0, 2.0, 3.0}));
  EXPECT_EQ(publisher_->Status().outbox.frames_dropped, 0U);
}

TEST_F(PublisherTest, WithoutRoomOnlyFramesGiveWay) {
  NatsServer nats;
  Start(nats.url(), {.frames_detail = Detail::kFull, .queue_mb = 1});
  ASSERT_TRUE(Wait([](const PublishStatus& status) { return status.connected && status.trouble.empty(); }));
  nats.Kill();
  ASSERT_TRUE(Wait([](const PublishStatus& status) { return !status.connected; }));
  uint64_t sequence = 0;
  while (publisher_->Status().outbox.frames_dropped < 5 && sequence < 2000) {
    PublishFrame(++sequence);
    Wait([&](const PublishStatus& status) {
      return status.outbox.waiting + status.outbox.frames_dropped >= 2 * sequence;
    });
  }
  const PublishStatus status = publisher_->Status();
  EXPECT_LT(sequence, 2000U);
  EXPECT_LE(status.outbox.bytes, 1'000'000U);
  EXPECT_EQ(status.outbox.others_dropped, 0U);
  nats.Start();
  ASSERT_TRUE(WaitUntilAcknowledged(2 * sequence - status.outbox.frames_dropped));
  const auto all = ReadStream(nats.url(), "TACLINK_lab", [&](const std::vector<Stored>& read) {
    return CountOf(read, "contacts") >= sequence &&
           CountOf(read, "frame") >= sequence - status.outbox.frames_dropped;
  });
  const size_t contacts = SequencesOf(all, "taclink.lab.test.lower.contacts").size() +
                          SequencesOf(all, "taclink.lab.test.upper.contacts").size();
  EXPECT_EQ(contacts, sequence);
  const auto frames = SequencesOf(all, "taclink.lab.test.lower.frame");
  ASSERT_FALSE(frames.empty());
  EXPECT_GT(frames.front(), 1U);  // the oldest gave way
  EXPECT_EQ(frames.back(), sequence % 2 == 1 ? sequence : sequence - 1);
}

TEST_F(PublisherTest, SaysWhatIsWrong) {
  NatsServer plain("", false);
  Start(plain.url());
  EXPECT_TRUE(Wait([](const PublishStatus& status) {
    return status.trouble.find("does that server have JetStream") != std::string::npos;
  })) << publisher_->Status().trouble;

  NatsServer guarded("authorization { token: \"secret\" }");
  auto config = PublishConfig{.url = guarded.url(), .site = "lab", .stream = "S"};
  publisher_ = std::move(*Publisher::Start(server_.arm(), config));
  EXPECT_TRUE(Wait([](const PublishStatus& status) {
    return status.trouble.find("refuses this user") != std::string::npos;
  })) << publisher_->Status().trouble;

  config.token_file = guarded.folder() + "/token";
  const auto missing = Publisher::Start(server_.arm(), config);
  ASSERT_FALSE(missing.ok());
  EXPECT_THAT(missing.error().message, HasSubstr("token cannot be read"));
  std::ofstream(config.token_file) << "wrong\n";
  chmod(config.token_file.c_str(), 0644);
  const auto open = Publisher::Start(server_.arm(), config);
  ASSERT_FALSE(open.ok());
  EXPECT_THAT(open.error().message, AllOf(HasSubstr("publish.token_file"), HasSubstr("chmod 640")));
  chmod(config.token_file.c_str(), 0600);
  publisher_ = std::move(*Publisher::Start(server_.arm(), config));
  ASSERT_TRUE(Wait([](const PublishStatus& status) {
    return status.trouble.find("refuses this user") != std::string::npos;
  }));
  std::ofstream(config.token_file) << "secret\n";  // is noticed without a restart
  EXPECT_TRUE(Wait([](const PublishStatus& status) { return status.connected && status.trouble.empty(); }))
      << publisher_->Status().trouble;
}

// A link that is started again counts from 1 again, one without pictures does not count on.
TEST_F(PublisherTest, FramesOfTheSameNumberAreAllKept) {
  NatsServer nats;
  Start(nats.url());
  for (const uint64_t sequence : {1, 3, 3, 1, 3}) PublishFrame(sequence);
  ASSERT_TRUE(WaitUntilAcknowledged(10));
  const auto all = ReadStream(nats.url(), "TACLINK_lab",
                              [](const std::vector<Stored>& read) { return CountOf(read, "frame") >= 5; });
  EXPECT_THAT(SequencesOf(all, "taclink.lab.test.lower.frame"), ElementsAreArray({1, 3, 3, 1, 3}));
  EXPECT_TRUE(Wait([](const PublishStatus& status) { return status.outbox.bytes == 0; }));
}

TEST_F(PublisherTest, WhatWasPublishedLastIsStoredBeforeItEnds) {
  NatsServer nats;
  Start(nats.url());
  ASSERT_TRUE(Wait([](const PublishStatus& status) { return status.connected && status.trouble.empty(); }));
  for (uint64_t i = 1; i <= 40; ++i) PublishFrame(i);
  publisher_->Close(kLimit);
  const auto all = ReadStream(nats.url(), "TACLINK_lab",
                              [](const std::vector<Stored>& read) { return CountOf(read, "frame") >= 40; });
  EXPECT_EQ(CountOf(all, "frame"), 40U);
}

TEST_F(PublisherTest, ClosesAtOnceWithoutAServer) {
  Start("nats://127.0.0.1:1");
  PublishFrame(1);
  ASSERT_TRUE(Wait([](const PublishStatus& status) { return status.outbox.waiting >= 2; }));
  publisher_->Close(std::chrono::hours(1));  // would wait so long for one that is there
}

}  // namespace
}  // namespace taclink::server
