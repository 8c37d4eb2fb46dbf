#include "server/gateway/grpc_call.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace taclink::server
