#include "server/process/systemd_notify.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <string_view>

namespace taclink::server {
namespace {

std::string Environment(const char* name) {
  const char* const value = std::getenv(name);  // NOLINT(concurrency-mt-unsafe): before there are threads
  return value == nullptr ? "" : value;
}

int64_t Integer(const std::string& text) {
  int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() ? value : 0;
}

}  // namespace

SystemdNotifier SystemdNotifier::FromEnvironment() {
  const std::string pid = Environment("WATCHDOG_PID");
  const bool mine = pid.empty() || Integer(pid) == getpid();
  return {Environment("NOTIFY_SOCKET"),
          mine ? std::max<int64_t>(Integer(Environment("WATCHDOG_USEC")), 0) * 1000 : 0};
}

bool SystemdNotifier::Send(const std::string& lines) const {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (socket_.empty() || socket_.size() >= sizeof(address.sun_path)) return false;
  std::copy(socket_.begin(), socket_.end(), address.sun_path);
  size_t length = offsetof(sockaddr_un, sun_path) + socket_.size();
  if (socket_[0] == '@') {
    address.sun_path[0] = '\0';  // an abstract name has no terminator
  } else {
    ++length;
  }
  const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return false;
  const auto sent = sendto(fd, lines.data(), lines.size(), MSG_NOSIGNAL | MSG_DONTWAIT,
                           reinterpret_cast<const sockaddr*>(&address), static_cast<socklen_t>(length));
  close(fd);
  return sent == static_cast<ssize_t>(lines.size());
}

}  // namespace taclink::server
