// The listener by itself: who is handed over, and what becomes of descriptors.
#include "server/listener/listener.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <thread>
#include <vector>

#include "tests/integration/raw_socket.h"
#include "tests/server/support.h"
#include "tests/support/http2_frames.h"

namespace taclink::server {
namespace {

using ::testing::HasSubstr;

/// Takes over what comes, and closes it as gRPC does.
class Taker {
 public:
  ~Taker() {
    for (const int fd : fds_) Close(fd);
  }
  void Take(int fd) {
    const std::lock_guard lock(mutex_);
    fds_.push_back(fd);
    changed_.notify_all();
  }
  int Wait(size_t count) {
    std::unique_lock lock(mutex_);
    EXPECT_TRUE(changed_.wait_for(lock, kForever, [&] { return fds_.size() >= count; }));
    return fds_.size() < count ? -1 : fds_[count - 1];
  }
  static void Close(int fd) {
    ::shutdown(fd, SHUT_RDWR);
    ::close(fd);
  }
  void CloseAll() {
    const std::lock_guard lock(mutex_);
    for (const int fd : std::exchange(fds_, {})) Close(fd);
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<int> fds_;
};

size_t OpenFiles() {
  size_t count = 0;
  for ([[maybe_unused]] const auto& file : std::filesystem::directory_iterator("/proc/self/fd")) ++count;
  return count;
}

// Registrations with epoll in this process (proc(5)).
size_t WatchedFiles() {
  size_t count = 0;
  for (const auto& file : std::filesystem::directory_iterator("/proc/self/fdinfo")) {
    std::ifstream info(file.path());
    for (std::string line; std::getline(info, line);) count += line.starts_with("tfd:") ? 1 : 0;
  }
  return count;
}

class ListenerTest : public ::testing::Test {
 protected:
  void Begin(const ListenerOptions& options = {.address = "127.0.0.1:0", .connections = {.all = 64}}) {
    auto listener = Listener::Open(options);
    ASSERT_TRUE(listener.ok()) << listener.error().message;
    listener_ = std::move(*listener);
    ASSERT_TRUE(listener_->Begin([this](int fd) { taker_.Take(fd); }).ok());
  }
  void WaitForConnections(uint64_t count) const {
    const auto give_up = std::chrono::steady_clock::now() + kForever;
    while (listener_->counts().connections != count && std::chrono::steady_clock::now() < give_up)
      std::this_thread::yield();
    EXPECT_EQ(listener_->counts().connections, count);
  }

  Taker taker_;
  std::unique_ptr<Listener> listener_;
};

TEST_F(ListenerTest, ConnectionsAreHandedOverAndTheirEndIsSeen) {
  Begin();
  const size_t before = OpenFiles();
  for (int round = 0; round < 3; ++round) {
    std::vector<RawSocket> clients;
    for (size_t i = 1; i <= 5; ++i) {
      clients.emplace_back(listener_->address());
      taker_.Wait(i);
    }
    WaitForConnections(5);
    taker_.CloseAll();
    for (const auto& client : clients) EXPECT_TRUE(client.WaitForEnd(kForever));
    WaitForConnections(0);
  }
  EXPECT_EQ(OpenFiles(), before);
}

TEST_F(ListenerTest, TheOldestSilentConnectionGivesWay) {
  Begin();
  std::vector<RawSocket> clients;
  for (size_t i = 1; i <= 7; ++i) {
    clients.emplace_back(listener_->address());
    taker_.Wait(i);
  }
  EXPECT_TRUE(clients[0].WaitForEnd(kForever));
  EXPECT_EQ(listener_->counts().refused, 1u);
}

// The bytes pass through this program's recvmsg, as those that gRPC reads.
TEST_F(ListenerTest, AFloodEndsItsConnectionWhileItIsRead) {
  Begin();
  const RawSocket client(listener_->address());
  const int fd = taker_.Wait(1);
  std::string flood = taclink::testing::Preface();
  for (int i = 0; i < 2000; ++i)
    flood += taclink::testing::Frame(taclink::testing::Http2Frame::kSettings, 0, 0);
  client.Send(flood);
  std::array<char, 1000> block{};
  iovec piece{.iov_base = block.data(), .iov_len = block.size()};
  msghdr message{};
  message.msg_iov = &piece;
  message.msg_iovlen = 1;
  ssize_t received = 0;
  int number = 0;
  do {
    received = ::recvmsg(fd, &message, 0);
    number = errno;
  } while (received > 0 || (received < 0 && number == EAGAIN));
  EXPECT_EQ(received, -1);
  EXPECT_EQ(number, ECONNRESET);
  EXPECT_EQ(listener_->counts().violations, 1u);
}

TEST_F(ListenerTest, ADescriptorThatIsUsedAgainIsNotMistakenForTheConnection) {
  Begin();
  const RawSocket client(listener_->address());
  const int fd = taker_.Wait(1);
  int pair[2];
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair), 0);
  ASSERT_EQ(::dup2(pair[0], fd), fd);  // the listener can't know yet
  std::string flood = taclink::testing::Preface();
  for (int i = 0; i < 2000; ++i)
    flood += taclink::testing::Frame(taclink::testing::Http2Frame::kSettings, 0, 0);
  ASSERT_EQ(::write(pair[1], flood.data(), flood.size()), static_cast<ssize_t>(flood.size()));
  std::vector<char> block(flood.size());
  iovec piece{.iov_base = block.data(), .iov_len = block.size()};
  msghdr message{};
  message.msg_iov = &piece;
  message.msg_iovlen = 1;
  EXPECT_EQ(::recvmsg(fd, &message, MSG_WAITALL), static_cast<ssize_t>(flood.size()));
  ::close(pair[0]);
  ::close(pair[1]);
}

// gRPC keeps its descriptor while a call is under way, although its client has gone.
TEST_F(ListenerTest, AConnectionThatEndedIsForgottenWhileItsDescriptorIsOpen) {
  Begin();
  const size_t watched = WatchedFiles();
  int fd = -1;
  {
    const RawSocket client(listener_->address());
    fd = taker_.Wait(1);
  }
  ::shutdown(fd, SHUT_RDWR);
  WaitForConnections(0);
  EXPECT_EQ(WatchedFiles(), watched) << "the registration with epoll has gone, too";
}

TEST_F(ListenerTest, NoneIsHandedOverOnceItIsClosed) {
  Begin();
  const RawSocket first(listener_->address());
  taker_.Wait(1);
  listener_->Close();
  const RawSocket late(listener_->address());
  EXPECT_FALSE(late.connected());
  listener_->Close();
}

TEST_F(ListenerTest, AnAddressInUseAndAnUnknownHostAreErrors) {
  Begin();
  const auto again = Listener::Open({.address = listener_->address(), .connections = {.all = 16}});
  ASSERT_FALSE(again.ok());
  EXPECT_THAT(again.error().message, ::testing::AllOf(HasSubstr(listener_->address()), HasSubstr("in use")));
  EXPECT_FALSE(Listener::Open({.address = "no-such-host.invalid:1", .connections = {.all = 16}}).ok());
}

TEST_F(ListenerTest, LocalhostIsAllItsAddressesAtOnePort) {
  Begin({.address = "localhost:0", .connections = {.all = 16}});
  const RawSocket client(listener_->address());
  EXPECT_TRUE(client.connected());
}

TEST_F(ListenerTest, AUnixSocketReplacesWhatNobodyListensOnAndRemovesItsFile) {
  const std::string path = ::testing::TempDir() + "listener." + std::to_string(::getpid());
  std::filesystem::remove(path);
  {
    const auto left_behind = Listener::Open({.address = "unix:" + path, .connections = {.all = 16}});
  }
  EXPECT_FALSE(std::filesystem::exists(path));
  Begin({.address = "unix:" + path, .connections = {.all = 16}});
  EXPECT_TRUE(std::filesystem::is_socket(path));
  const auto second = Listener::Open({.address = "unix:" + path, .connections = {.all = 16}});
  ASSERT_FALSE(second.ok());
  EXPECT_THAT(second.error().message, HasSubstr("process " + std::to_string(::getpid())));
  listener_.reset();
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace taclink::server
