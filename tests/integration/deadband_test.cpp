// The deadband as clients see it: a real server, real clients over gRPC.
#include <gtest/gtest.h>

#include "tests/integration/support.h"

namespace taclink::server {
namespace {

constexpr int64_t kFrameNs = 100'000'000;

// Contacts push with 0.1 N times the number; the markers move 1 mm.
void Publish(TestServer& server, uint64_t sequence, uint64_t number) {
  server.PublishNumbered(0, sequence, number, static_cast<int64_t>(sequence) * kFrameNs);
}

TEST(DeadbandStream, AQuietLinkSendsASmallFrameEverySecond) {
  TestServer server;
  auto client = server.Connect();
  auto request = Every(v1::DETAIL_FULL);
  request.set_deadband_force_n(0.15);
  const auto reader = Stream(client, request);
  uint64_t sequence = 0;
  for (int i = 0; i < 12; ++i) Publish(server, ++sequence, 5);
  v1::LinkFrame frame = NextOf(*reader);
  EXPECT_EQ(frame.sequence(), 1u);
  EXPECT_FALSE(frame.unchanged());
  EXPECT_EQ(frame.positions_m_size(), 3 * 256);
  frame = NextOf(*reader);
  EXPECT_EQ(frame.sequence(), 11u);
  EXPECT_TRUE(frame.unchanged());
  EXPECT_TRUE(frame.positions_m().empty());
  ASSERT_EQ(frame.contacts_size(), 1);
  EXPECT_NEAR(frame.contacts(0).normal_force_n(), 0.5, 1e-9);
  Publish(server, ++sequence, 6);  // 0.1 N more: within
  Publish(server, ++sequence, 7);
  frame = NextOf(*reader);
  EXPECT_EQ(frame.sequence(), sequence);
  EXPECT_FALSE(frame.unchanged());
  EXPECT_EQ(frame.positions_m_size(), 3 * 256);
  server.Stop();
  EXPECT_FALSE(reader->Next(kForever).ok());
  EXPECT_EQ(reader->status().links(0).frames_sent(), 3u);
  EXPECT_EQ(reader->status().links(0).frames_unchanged(), sequence - 3);
  EXPECT_EQ(reader->status().links(0).frames_dropped(), 0u);
}

TEST(DeadbandStream, MarkersCountInMetres) {
  TestServer server;
  auto client = server.Connect();
  auto request = Every();
  request.set_deadband_move_m(1.5e-3);
  const auto reader = Stream(client, request);
  for (const uint64_t number : {5, 6, 7, 8, 9}) Publish(server, number, number);
  for (const uint64_t number : {5, 7, 9}) EXPECT_EQ(NextOf(*reader).sequence(), number);
}

TEST(DeadbandStream, NonsenseIsRefused) {
  TestServer server;
  auto client = server.Connect();
  for (const double limit :
       {-1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    v1::StreamFramesRequest force, move;
    force.set_deadband_force_n(limit);
    move.set_deadband_move_m(limit);
    for (const auto& request : {force, move}) {
      const auto reader = client.StreamFrames(request);
      ASSERT_FALSE(reader.ok());
      EXPECT_EQ(reader.error().code, ErrorCode::kInvalidArgument);
      EXPECT_NE(reader.error().message.find("deadband"), std::string::npos);
    }
  }
}

TEST(DeadbandStream, NothingIsEncodedThatNobodyReads) {
  TestServer server;
  for (uint64_t i = 1; i <= 20; ++i) server.Publish(0, i);
  EXPECT_EQ(server.encoded(), (std::array<int, kDetailCount>{0, 0, 0}));
  auto client = server.Connect();
  const auto contacts = Stream(client, Every()), again = Stream(client, Every());
  auto lower = Every(v1::DETAIL_FULL);
  lower.add_links("lower");
  const auto other_link = Stream(client, lower);
  for (uint64_t i = 21; i <= 40; ++i) {
    server.Publish(0, i);
    NextOf(*contacts);
    NextOf(*again);
  }
  EXPECT_EQ(server.encoded(), (std::array<int, kDetailCount>{20, 0, 0}));
}

}  // namespace
}  // namespace taclink::server
