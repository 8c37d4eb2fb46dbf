#include "server/rpc/services/call_queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>

#include "tests/server/gate.h"

namespace taclink::server {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class CallQueueTest : public ::testing::Test {
 protected:
  void TearDown() override {
    gate_.Open();
    queue_.Join();
    other_queue_.Join();
  }
  // From now on its thread is kept, until the gate is opened.
  void Keep() {
    ASSERT_TRUE(queue_.Post({"keeper", true}, [this] { gate_.Pass(); }).ok());
    gate_.WaitForArrival();
  }
  Result<void> Ask(const Party& party) {
    return queue_.Post(party, [this] { ++answered_; });
  }

  Gate gate_;
  std::atomic<size_t> answered_ = 0;
  CallQueue queue_{"waiting calls that read logs"}, other_queue_{"waiting calls to the recorder"};
};

TEST_F(CallQueueTest, WhoAsksTooOftenIsRefusedAndNobodyElse) {
  Keep();
  const Party greedy{"viewer", true}, other{"operator", true};
  size_t accepted = 0;
  for (int i = 0; i < 300; ++i) {
    const auto asked = Ask(greedy);
    accepted += asked.ok() ? 1 : 0;
    if (asked) continue;
    EXPECT_EQ(asked.error().code, ErrorCode::kResourceExhausted);
    EXPECT_THAT(asked.error().message, AllOf(HasSubstr("all 16 waiting calls that read logs of viewer"),
                                             HasSubstr("wait for an answer")));
  }
  EXPECT_EQ(accepted, CallQueue::kMostWaitingPerParty);
  EXPECT_TRUE(Ask(other).ok());
  gate_.Open();
  queue_.Join();
  EXPECT_EQ(answered_, accepted + 1);
}

TEST_F(CallQueueTest, OfAllOnlySoManyWait) {
  Keep();
  size_t accepted = 0;
  for (int i = 0; i < 1000; ++i) accepted += Ask({"party " + std::to_string(i), true}).ok() ? 1 : 0;
  EXPECT_EQ(accepted, CallQueue::kMostWaiting);
}

TEST_F(CallQueueTest, WhoWasAnsweredMayAskAtOnce) {
  const Party party{"viewer", true};
  Keep();
  std::atomic<bool> asked_again = false;
  ASSERT_TRUE(queue_.Post(party, [&] { asked_again = Ask(party).ok(); }).ok());
  for (size_t i = 1; i < CallQueue::kMostWaitingPerParty; ++i) ASSERT_TRUE(Ask(party).ok());
  ASSERT_FALSE(Ask(party).ok());
  gate_.Open();
  queue_.Join();
  EXPECT_TRUE(asked_again);
}

TEST_F(CallQueueTest, QueuesDoNotWaitForEachOther) {
  Keep();
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(Ask({"viewer", true}).ok());
  Gate done;
  ASSERT_TRUE(other_queue_.Post({"operator", true}, [&done] { done.Pass(); }).ok());
  done.WaitForArrival();  // hangs where it waits for the others
  EXPECT_EQ(answered_, 0U);
  done.Open();
  other_queue_.Join();
}

}  // namespace
}  // namespace taclink::server
