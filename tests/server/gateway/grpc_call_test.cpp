#include "server/gateway/grpc_call.h"

#include <gtest/gtest.h>

#include <condition_variable>
#include <future>
#include <memory>
#include <thread>

#include "tests/integration/support.h"

namespace taclink::server {
namespace {

// gRPC's callback thread must not be the last owner of the channel: it would end itself.
TEST(GrpcCalls, OutliveWhatGrpcStillDoesForThem) {
  auto server = std::make_unique<TestServer>();
  auto calls = std::make_unique<GrpcCalls>(server->server().InProcessChannel());
  std::promise<void> answered, in_last, go_on;
  const auto gone_on = go_on.get_future().share();
  int told = 0;  // gRPC tells one after the other: the answer, then the end
  auto call = calls->Start({.method = "/taclink.v1.TactileService/GetArm",
                            .messages = {""},
                            .timeout = kForever,
                            .peer = "test",
                            .name = {}},
                           [&] {
                             if (++told == 1) return answered.set_value();
                             in_last.set_value();
                             gone_on.wait();
                           });
  answered.get_future().wait();
  ASSERT_TRUE(call->Take());
  in_last.get_future().wait();
  ASSERT_TRUE(std::holds_alternative<WebStatus>(*call->Take()));
  call.reset();
  server.reset();
  std::jthread waiter([&] { calls.reset(); });
  go_on.set_value();
}

// The browser is slow: an answer waits, and none is asked for, when the server ends the call.
TEST(GrpcCalls, TheEndIsSeenAlsoWhereAnAnswerWaits) {
  for (int round = 0; round < 20; ++round) {
    TestServer server;
    GrpcCalls calls(server.server().InProcessChannel());
    std::mutex mutex;
    std::condition_variable changed;
    int notified = 0;
    auto call = calls.Start({.method = "/taclink.v1.TactileService/StreamFrames",
                             .messages = {""},
                             .timeout = kForever,
                             .peer = "test",
                             .name = {}},
                            [&] {
                              const std::lock_guard lock(mutex);
                              ++notified;
                              changed.notify_all();
                            });
    const auto wait = [&](int count) {
      std::unique_lock lock(mutex);
      return changed.wait_for(lock, std::chrono::seconds(10), [&] { return notified >= count; });
    };
    ASSERT_TRUE(wait(1));  // the status waits here
    std::jthread ender([&] { server.server().Shutdown("the test is over", kForever); });
    std::this_thread::sleep_for(std::chrono::milliseconds(5 * (round % 5)));
    bool ended = false;
    const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    while (!ended && std::chrono::steady_clock::now() < give_up) {
      const auto event = call->Take();
      ended = event && std::holds_alternative<WebStatus>(*event);
      if (!event) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_TRUE(ended) << round;
    call.reset();
  }
}

}  // namespace
}  // namespace taclink::server
