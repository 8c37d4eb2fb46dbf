#include "server/process/send_delay.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>
#include <thread>
#include <utility>

namespace taclink::server {
namespace {

using namespace std::chrono_literals;

// Worked out by hand: of 100 kB/s 5 kB are delivered in 50 ms.
TEST(SendDelay, WhatIsQueuedIsDeliveredSoon) {
  SendState slow{.bytes_per_s = 100'000, .round_trip = 100us};
  for (const auto& [queued, delay] : {std::pair(4'900.0, 0ms), {9'000.0, 40ms}, {17'000.0, 100ms}}) {
    slow.queued_bytes = queued;
    EXPECT_EQ(SendDelay(slow), delay) << queued;
  }
  slow.shortest_round_trip = slow.round_trip = 150ms;
  EXPECT_EQ(SendDelay(slow), 0ms) << "a long round trip holds more";
}

TEST(SendDelay, AFastLinkIsNotWaitedFor) {
  EXPECT_EQ(
      SendDelay(
          {.queued_bytes = 1e6, .bytes_per_s = 50e6, .shortest_round_trip = 200us, .round_trip = 300us}),
      0ms);
  EXPECT_EQ(SendDelay({.queued_bytes = 3000}), 0ms) << "nothing is known yet";
}

TEST(SendDelay, NothingIsKnownUntilTheFirstAcknowledgement) {
  EXPECT_EQ(SendDelay({.queued_bytes = 17'000}), 5ms);
}

TEST(SendDelay, ARateThatTheLinkContradictsIsNotBelieved) {
  SendState burst{
      .queued_bytes = 17'000, .bytes_per_s = 1e6, .shortest_round_trip = 1ms, .round_trip = 150ms};
  EXPECT_EQ(SendDelay(burst), 0ms);
  burst.round_trip = 250ms;
  EXPECT_EQ(SendDelay(burst), 14ms) << "a router has taken a burst at once, and sends it slowly";
  burst.round_trip = 1ms;
  burst.since_acknowledgement = 90ms;
  EXPECT_EQ(SendDelay(burst), 0ms);
  burst.since_acknowledgement = 2000ms;
  EXPECT_EQ(SendDelay(burst), 14ms) << "the link stalls";
}

// Two ends of a connection, of which the receiver has room for little.
class SendDelayOfASocket : public ::testing::Test {
 protected:
  void SetUp() override {
    listener_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const int room = 4096;
    ASSERT_EQ(::setsockopt(listener_, SOL_SOCKET, SO_RCVBUF, &room, sizeof room), 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    ASSERT_EQ(::bind(listener_, reinterpret_cast<const sockaddr*>(&address), size), 0);
    ASSERT_EQ(::listen(listener_, 1), 0);
    ASSERT_EQ(::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    sender_ = ::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    ::connect(sender_, reinterpret_cast<const sockaddr*>(&address), size);
    receiver_ = ::accept(listener_, nullptr, nullptr);
    ASSERT_GE(receiver_, 0);
  }
  void TearDown() override {
    for (const int file : {listener_, sender_, receiver_}) ::close(file);
  }
  int listener_ = -1, sender_ = -1, receiver_ = -1;
};

TEST_F(SendDelayOfASocket, LastsUntilTheReceiverHasRead) {
  EXPECT_EQ(SendDelay(sender_), 0ms);
  std::string frame(60'000, 'x');
  ASSERT_GT(::send(sender_, frame.data(), frame.size(), MSG_NOSIGNAL), 20'000);
  while (SendDelay(sender_) == 0ms) std::this_thread::sleep_for(1ms);  // until the link is seen to stall
  ::shutdown(sender_, SHUT_WR);
  while (::recv(receiver_, frame.data(), frame.size(), 0) > 0) continue;
  while (SendDelay(sender_) > 0ms) std::this_thread::sleep_for(1ms);  // its end is acknowledged, too
}

TEST(SendDelay, WhatIsNoConnectionOfTcpIsNotWaitedFor) {
  int pair[2];
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair), 0);
  const std::string bytes(10'000, 'x');
  ASSERT_EQ(::send(pair[0], bytes.data(), bytes.size(), MSG_NOSIGNAL), 10'000);
  EXPECT_EQ(SendDelay(pair[0]), 0ms);
  EXPECT_EQ(SendDelay(-1), 0ms);
  for (const int file : pair) ::close(file);
}

}  // namespace
}  // namespace taclink::server
