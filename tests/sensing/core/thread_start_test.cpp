#include "sensing/core/thread_start.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>

#include <array>
#include <future>
#include <memory>
#include <stdexcept>
#include <thread>

namespace taclink {
namespace {

using ::testing::HasSubstr;

std::string OwnName() {
  std::array<char, 16> text{};
  pthread_getname_np(pthread_self(), text.data(), text.size());
  return text.data();
}

std::string NameOf(const std::string& asked) {
  std::string name;
  EXPECT_TRUE(StartThread(asked, [&] { name = OwnName(); }).ok());  // joins
  return name;
}

/// Where it is destroyed.
struct Traced {
  explicit Traced(std::promise<std::thread::id>& at_end) : end(&at_end) {}
  Traced(Traced&& other) noexcept : end(std::exchange(other.end, nullptr)) {}
  Traced& operator=(Traced&&) = delete;
  ~Traced() {
    if (end != nullptr) end->set_value(std::this_thread::get_id());
  }
  std::promise<std::thread::id>* end;
};

void AwaitNoneDetached() {
  while (DetachedThreads() > 0) std::this_thread::yield();
}

TEST(ThreadStart, ANameIsCutToWhatTheSystemKeeps) {
  EXPECT_EQ(NameOf("fem:upper"), "fem:upper");
  EXPECT_EQ(NameOf("cap:a-link-with-a-long-name"), "cap:a-link-with");
}

TEST(ThreadStart, ABodyIsToldToStop) {
  auto thread = StartThread("stops", [](const std::stop_token& stop) {
    while (!stop.stop_requested()) std::this_thread::yield();
  });
  ASSERT_TRUE(thread.ok());
}  // requests the stop and joins

TEST(ThreadStart, AShortageIsAnErrorThatNamesTheThreadAndTheLimits) {
  const auto held = std::make_shared<int>();
  const ThreadShortage shortage("rec");
  const auto thread = StartThread("recording", [held] {});
  ASSERT_FALSE(thread.ok());
  EXPECT_EQ(thread.error().code, ErrorCode::kResourceExhausted);
  EXPECT_THAT(thread.error().message, HasSubstr("no thread can be started for recording: "));
  EXPECT_THAT(thread.error().message, HasSubstr("TasksMax"));
  EXPECT_THAT(thread.error().message, HasSubstr("pids.max"));
  EXPECT_EQ(held.use_count(), 1) << "the body is gone";
  EXPECT_FALSE(StartDetachedThread("recording", [held] {}).ok());
  EXPECT_FALSE(RunDetached("recording", [held] { return 1; }).ok());
  EXPECT_THROW(MustStartThread("recording", [held] {}), std::runtime_error);
  EXPECT_EQ(held.use_count(), 1);
  EXPECT_EQ(shortage.refused(), 4);
  EXPECT_EQ(DetachedThreads(), 0);
  EXPECT_TRUE(StartThread("other", [] {}).ok());
}

TEST(ThreadStart, ADetachedThreadIsCountedUntilItsBodyIsGone) {
  std::promise<void> go;
  std::promise<std::thread::id> end;
  ASSERT_TRUE(
      StartDetachedThread("waits", [traced = Traced(end), may = go.get_future()] { may.wait(); }).ok());
  EXPECT_EQ(DetachedThreads(), 1);
  go.set_value();
  EXPECT_NE(end.get_future().get(), std::this_thread::get_id());
  AwaitNoneDetached();
}

TEST(ThreadStart, AResultOrAnExceptionArrives) {
  auto value = RunDetached("value", [] { return 42; });
  ASSERT_TRUE(value.ok());
  EXPECT_EQ(value->get(), 42);
  auto failure = RunDetached("failure", []() -> int { throw std::runtime_error("no"); });
  ASSERT_TRUE(failure.ok());
  EXPECT_THROW(failure->get(), std::runtime_error);
  AwaitNoneDetached();
}

// A future of std::async would wait here for good.
TEST(ThreadStart, NobodyWaitsForAResultThatComesTooLate) {
  std::promise<void> go;
  std::promise<std::thread::id> end;
  {
    const auto late = RunDetached("late", [&end, may = go.get_future()] {
      may.wait();
      return std::make_unique<Traced>(end);
    });
    ASSERT_TRUE(late.ok());
  }
  go.set_value();
  EXPECT_NE(end.get_future().get(), std::this_thread::get_id()) << "destroyed on the thread that made it";
  AwaitNoneDetached();
}

}  // namespace
}  // namespace taclink
