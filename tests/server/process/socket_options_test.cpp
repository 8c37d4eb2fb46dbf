#include "server/process/socket_options.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>

namespace taclink::server {
namespace {

// What a sender gets rid of while the receiver reads nothing, beyond what the receiver has room for.
TEST(BoundUnsent, LittleWaitsInTheKernelForASlowReceiver) {
  const int listener = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int room = 4096;
  ASSERT_EQ(::setsockopt(listener, SOL_SOCKET, SO_RCVBUF, &room, sizeof room), 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ASSERT_EQ(::bind(listener, reinterpret_cast<const sockaddr*>(&address), size), 0);
  ASSERT_EQ(::listen(listener, 2), 0);
  ASSERT_EQ(::getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size), 0);
  const auto accepted_bytes = [&](bool bounded) {
    const int sender = ::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    ::connect(sender, reinterpret_cast<const sockaddr*>(&address), size);
    const int receiver = ::accept(listener, nullptr, nullptr);
    if (bounded) BoundUnsent(sender);
    const std::string block(1000, 'x');
    size_t sum = 0;
    for (ssize_t sent = 0; (sent = ::send(sender, block.data(), block.size(), MSG_NOSIGNAL)) > 0;)
      sum += static_cast<size_t>(sent);
    ::close(sender);
    ::close(receiver);
    return sum;
  };
  const size_t usual = accepted_bytes(false), bounded = accepted_bytes(true);
  ::close(listener);
  EXPECT_LT(bounded, 32'000u);
  EXPECT_GT(usual, 2 * bounded);
}

}  // namespace
}  // namespace taclink::server
