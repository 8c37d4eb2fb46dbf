#include "server/link/command_queue.h"

#include <gtest/gtest.h>

#include <atomic>
#include <optional>
#include <stdexcept>
#include <thread>

namespace taclink::server {
namespace {

using Queue = CommandQueue<int>;

struct Answer {
  std::atomic<int> count = 0;
  std::optional<Result<void>> result;  // read after count is 1

  Queue::Done Taker() {
    return [this](const Result<void>& end) {
      result = end;
      ++count;
      count.notify_all();
    };
  }
};

Queue::Run Add(int what) {
  return [what](int& target) -> Result<void> {
    target = 10 * target + what;
    return {};
  };
}

TEST(CommandQueue, RunsInOrderAndAnswersEachOnce) {
  Queue queue;
  Answer first, second;
  ASSERT_TRUE(queue.Post(Add(1), first.Taker()).ok());
  ASSERT_TRUE(queue.Post(Add(2), second.Taker()).ok());
  int target = 0;
  EXPECT_EQ(first.count, 0);
  queue.RunAll(target);
  queue.RunAll(target);
  EXPECT_EQ(target, 12);
  EXPECT_EQ(first.count, 1);
  EXPECT_EQ(second.count, 1);
  EXPECT_TRUE(second.result->ok());
}

TEST(CommandQueue, WhatACommandThrowsIsItsResult) {
  Queue queue;
  Answer answer;
  ASSERT_TRUE(
      queue.Post([](int&) -> Result<void> { throw std::runtime_error("no memory"); }, answer.Taker()).ok());
  int target = 0;
  queue.RunAll(target);
  ASSERT_EQ(answer.count, 1);
  EXPECT_EQ(answer.result->error().code, ErrorCode::kInternal);
  EXPECT_EQ(answer.result->error().message, "the command failed: no memory");
}

TEST(CommandQueue, ACommandThatPostsAnotherDoesNotHoldTheThread) {
  Queue queue;
  Answer answer, next;
  const auto again = [&](int& target) -> Result<void> {
    ++target;
    return queue.Post(Add(5), next.Taker());
  };
  ASSERT_TRUE(queue.Post(again, answer.Taker()).ok());
  int target = 0;
  queue.RunAll(target);
  EXPECT_EQ(target, 1);
  EXPECT_EQ(next.count, 0);
  queue.RunAll(target);
  EXPECT_EQ(next.count, 1);
}

TEST(CommandQueue, RefusesBeyondItsCapacityAndAfterClose) {
  Queue queue;
  Answer answer;
  int accepted = 0;
  while (accepted < 1000 && queue.Post(Add(1), answer.Taker()).ok()) ++accepted;
  EXPECT_EQ(accepted, 16);
  EXPECT_EQ(queue.Post(Add(1), answer.Taker()).error().code, ErrorCode::kResourceExhausted);
  queue.Close({ErrorCode::kUnavailable, "the link is stopping"});
  EXPECT_EQ(answer.count, accepted);
  EXPECT_EQ(answer.result->error().message, "the link is stopping");
  EXPECT_EQ(queue.Post(Add(1), answer.Taker()).error().code, ErrorCode::kUnavailable);
  int target = 0;
  queue.RunAll(target);
  EXPECT_EQ(target, 0);
  EXPECT_EQ(answer.count, accepted);
}

TEST(CommandQueue, CloseAnswersForACommandThatHangs) {
  Queue queue;
  Answer hanging, waiting;
  std::atomic<bool> runs = false, goes_on = false;
  const auto hang = [&](int&) -> Result<void> {
    runs = true;
    runs.notify_all();
    goes_on.wait(false);
    return {};
  };
  ASSERT_TRUE(queue.Post(hang, hanging.Taker()).ok());
  ASSERT_TRUE(queue.Post(Add(1), waiting.Taker()).ok());
  int target = 0;
  std::jthread worker([&] { queue.RunAll(target); });
  runs.wait(false);
  queue.Close({ErrorCode::kUnavailable, "given up"});
  EXPECT_EQ(hanging.count, 1);
  EXPECT_EQ(waiting.count, 1);
  goes_on = true;
  goes_on.notify_all();
  worker.join();
  EXPECT_EQ(hanging.count, 1) << "answered again";
  EXPECT_EQ(target, 0);
  EXPECT_FALSE(hanging.result->ok());
}

}  // namespace
}  // namespace taclink::server
