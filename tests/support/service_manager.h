#pragma once

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstring>
#include <string>

namespace taclink {

/// Listens as systemd does, for what a service tells it.
class ServiceManager {
 public:
  /// A path, or "@..." for an abstract name.
  explicit ServiceManager(std::string name) : fd_(socket(AF_UNIX, SOCK_DGRAM, 0)), name_(std::move(name)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, name_.data(), name_.size());
    if (name_[0] == '@') address.sun_path[0] = '\0';
    const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name_.size());
    EXPECT_EQ(bind(fd_, reinterpret_cast<const sockaddr*>(&address), length), 0);
    const timeval patience{.tv_sec = 60, .tv_usec = 0};
    setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
  }
  ~ServiceManager() { close(fd_); }
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

  /// What has come; "nothing": nothing.
  std::string Received() const { return Receive(MSG_DONTWAIT); }
  /// Waits for the first message that begins so; others are passed over.
  std::string Await(const std::string& begin) const {
    for (int i = 0; i < 1000; ++i) {
      std::string message = Receive(0);
      if (message.starts_with(begin)) return message;
      if (message == kNothing) break;
    }
    ADD_FAILURE() << "systemd hears no " << begin;
    return "";
  }
  const std::string& name() const { return name_; }

 private:
  static constexpr const char* kNothing = "nothing";
  std::string Receive(int flags) const {
    std::array<char, 512> text{};
    const auto size = recv(fd_, text.data(), text.size(), flags);
    return size < 0 ? kNothing : std::string(text.data(), static_cast<size_t>(size));
  }

  const int fd_;
  const std::string name_;
};

}  // namespace taclink
