// Streams that outlive their server.
#include "client/cpp/taclink/follow.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <condition_variable>
#include <functional>
#include <mutex>

#include "sensing/core/thread_start.h"
#include "tests/integration/support.h"

namespace taclink::server {
namespace {

using client::Disconnection;
using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// What callbacks said, for the test's thread to wait on.
template <typename T>
class Heard {
 public:
  std::function<void(const T&)> Listener() {
    return [this](const T& value) {
      const std::lock_guard lock(mutex_);
      all_.push_back(value);
      came_.notify_all();
    };
  }
  /// The first `count`; fewer if they do not come.
  std::vector<T> Wait(size_t count) {
    std::unique_lock lock(mutex_);
    came_.wait_for(lock, kForever, [&] { return all_.size() >= count; });
    return all_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable came_;
  std::vector<T> all_;
};

/// A server that can be taken away and come back at the same address: a port could be another program's by
/// then.
class FollowTest : public ::testing::Test {
 protected:
  FollowTest() {
    options_.address = address_;
    options_.first_delay = milliseconds(1);
    options_.longest_delay = milliseconds(4);
    options_.on_connected = [this] { connected_.Listener()(true); };
    options_.on_disconnected = disconnected_.Listener();
    options_.on_refused = refused_.Listener();
  }

  const std::string address_ = "unix:" + NewFolder("follow");
  std::unique_ptr<TestServer> server_ = std::make_unique<TestServer>(
      TestLimits(), nullptr, TestServer::MakePressure{}, RecordingConfig{}, address_);
  Heard<bool> connected_;
  Heard<Disconnection> disconnected_;
  Heard<Error> refused_;
  client::FollowOptions options_;
};

TEST_F(FollowTest, FramesGoOnAfterABreak) {
  Heard<v1::LinkFrame> frames;
  const auto subscription = client::FollowFrames(options_, Every(), frames.Listener());
  connected_.Wait(1);
  server_->Publish(0, 1);
  ASSERT_EQ(frames.Wait(1).size(), 1U);
  server_->Stop();
  const auto lost = disconnected_.Wait(4);
  ASSERT_GE(lost.size(), 4U);
  EXPECT_THAT(lost[0].error.message, HasSubstr("server is shutting down"));
  EXPECT_EQ(lost[0].attempt, 1);
  EXPECT_EQ(lost[3].attempt, 4);
  for (const Disconnection& each : lost) EXPECT_LE(each.delay, milliseconds(5));  // 4 ms and a fifth
  EXPECT_THAT(lost[3].error.message, HasSubstr("no server answers at " + address_));

  TestServer other(TestLimits(), nullptr, {}, {}, address_);
  ASSERT_EQ(connected_.Wait(2).size(), 2U);
  other.Publish(0, 7);
  const auto all = frames.Wait(2);
  ASSERT_EQ(all.size(), 2U);
  EXPECT_EQ(all[0].sequence(), 1U);
  EXPECT_EQ(all[1].sequence(), 7U);
  EXPECT_FALSE(subscription->ended());
}

TEST_F(FollowTest, ARefusalIsTheEnd) {
  const auto subscription = client::FollowFrames(options_, OfLinks({"elbow"}), {});
  const auto refusals = refused_.Wait(1);
  ASSERT_EQ(refusals.size(), 1U);
  EXPECT_EQ(refusals[0].code, ErrorCode::kNotFound);
  EXPECT_THAT(refusals[0].message, HasSubstr("elbow"));
  subscription->Stop();
  EXPECT_TRUE(subscription->ended());
}

TEST_F(FollowTest, WithoutAThreadItIsRefusedAtOnce) {
  const ThreadShortage shortage("taclink-follow");
  const auto subscription = client::FollowFrames(options_, Every(), {});
  EXPECT_TRUE(subscription->ended());
  const auto refusals = refused_.Wait(1);
  ASSERT_EQ(refusals.size(), 1U);
  EXPECT_EQ(refusals[0].code, ErrorCode::kResourceExhausted);
  subscription->Stop();
}

TEST_F(FollowTest, ContactsAndEventsCome) {
  Heard<v1::StreamContactsResponse> contacts;
  const auto all_contacts = client::FollowContacts(options_, 0, contacts.Listener());
  connected_.Wait(1);
  server_->Publish(0, 1);
  EXPECT_FALSE(contacts.Wait(1).empty());
  server_->arm().events().Start();
  Heard<v1::Event> events;
  const auto all_events = client::FollowEvents(options_, {}, events.Listener());
  connected_.Wait(2);
  ASSERT_TRUE(server_->Connect().SetThresholds("upper", "", MakeThresholds(3)).ok());
  const auto heard = events.Wait(1);
  ASSERT_FALSE(heard.empty());
  EXPECT_EQ(heard[0].kind(), v1::EVENT_KIND_THRESHOLDS);
}

TEST_F(FollowTest, StopsWhileNobodyAnswersAndFromItsOwnCallback) {
  server_->Stop();
  server_.reset();
  options_.first_delay = options_.longest_delay = std::chrono::hours(1);
  const auto waits = client::FollowFrames(options_, {}, {});
  ASSERT_EQ(disconnected_.Wait(1).size(), 1U);
  waits->Stop();
  EXPECT_TRUE(waits->ended());

  std::atomic<client::Subscription*> itself = nullptr;
  Heard<bool> stopped;
  options_.on_disconnected = [&](const Disconnection&) {
    while (!itself) std::this_thread::yield();
    itself.load()->Stop();
    stopped.Listener()(true);
  };
  const auto stops = client::FollowFrames(options_, {}, {});
  itself = stops.get();
  EXPECT_EQ(stopped.Wait(1).size(), 1U);
}

}  // namespace
}  // namespace taclink::server
