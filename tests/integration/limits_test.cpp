// What clients may cost, and what they are told.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include "taclink/v1/tactile.grpc.pb.h"
#include "tests/integration/support.h"

namespace taclink::server {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(Limits, OneProgramGetsNoMoreThanItsShare) {
  ServiceLimits limits = TestLimits();
  limits.max_streams_per_peer = 2;
  TestServer server(limits);
  auto greedy = server.Connect(), other = server.Connect();
  const auto first = Stream(greedy, {});
  auto second = Stream(greedy, {});
  const auto refused = greedy.StreamFrames({});
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kResourceExhausted);
  EXPECT_THAT(refused.error().message,
              AllOf(HasSubstr("the connection ipv4:127.0.0.1:"), HasSubstr("limits.max_streams_per_peer")));
  EXPECT_TRUE(other.StreamFrames({}).ok());

  // Calls from within the process, as a gateway's, have limits of their own.
  const auto stub = v1::TactileService::NewStub(server.server().InProcessChannel());
  grpc::ClientContext context;
  const auto inside = stub->StreamFrames(&context, {});
  v1::StreamFramesResponse response;
  EXPECT_TRUE(inside->Read(&response));
  context.TryCancel();

  second.reset();
  const auto give_up = std::chrono::steady_clock::now() + kForever;
  bool admitted = false;  // the server hears of the end a moment later
  while (!admitted && std::chrono::steady_clock::now() < give_up) admitted = greedy.StreamFrames({}).ok();
  EXPECT_TRUE(admitted);
}

TEST(Limits, AMessageThatIsTooLargeIsRefused) {
  ServiceLimits limits = TestLimits();
  limits.max_message_bytes = 1000;
  TestServer server(limits);
  auto client = server.Connect();
  const auto huge = client.StreamFrames(OfLinks({std::string(2000, 'x')}));
  ASSERT_FALSE(huge.ok());
  EXPECT_EQ(huge.error().code, ErrorCode::kResourceExhausted);
  EXPECT_EQ(client.StreamFrames(OfLinks({std::string(500, 'x')})).error().code, ErrorCode::kNotFound);
}

TEST(Limits, WhatWaitsIsBoundedInBytes) {
  ServiceLimits limits = TestLimits();
  limits.queue_messages = 100'000;
  limits.queue_bytes = size_t{2} << 20;
  TestServer server(limits);
  auto client = server.Connect();
  const auto stopped = Stream(client, Every(v1::DETAIL_FULL));
  constexpr uint64_t kFrames = 3000;
  int most_alive = 0;
  for (uint64_t i = 1; i <= kFrames; ++i) {
    server.Publish(0, i);
    most_alive = std::max(most_alive, server.states_alive());
  }
  // A state of 256 markers takes more than 32 kB.
  EXPECT_LT(most_alive, 2048 / 32 + 8);
  std::thread stop([&] { server.Stop(); });
  uint64_t received = 0;
  while (stopped->Next(kForever).ok()) ++received;
  stop.join();
  const v1::LinkStreamCounts& counts = stopped->status().links(0);
  EXPECT_EQ(counts.frames_sent(), received);
  EXPECT_GT(counts.frames_dropped(), 0u);
  EXPECT_EQ(counts.frames_dropped_for_bytes(), counts.frames_dropped());
}

TEST(Limits, WhatWaitsForAllStreamsOfAPartyIsBoundedInBytes) {
  ServiceLimits limits = TestLimits();
  limits.queue_messages = 100'000;
  limits.queue_bytes_per_peer = size_t{2} << 20;
  TestServer server(limits);
  auto greedy = server.Connect(), other = server.Connect();
  const auto a = Stream(greedy, Every(v1::DETAIL_FULL)), b = Stream(greedy, Every(v1::DETAIL_FULL));
  const auto reader = Stream(other, Every(v1::DETAIL_FULL));
  int most_alive = 0;
  for (uint64_t i = 1; i <= 2000; ++i) {
    server.Publish(0, i);
    EXPECT_EQ(NextOf(*reader).sequence(), i) << "others lose nothing";
    most_alive = std::max(most_alive, server.states_alive());
  }
  // A state of 256 markers takes more than 32 kB.
  EXPECT_LT(most_alive, 2048 / 32 + 16);
}

}  // namespace
}  // namespace taclink::server
