#include "server/listener/listening_socket.h"

#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <memory>
#include <system_error>
#include <utility>

#include "sensing/core/address.h"
#include "server/process/unix_socket.h"

namespace taclink::server {
namespace {

constexpr std::string_view kUnixScheme = "unix:";
constexpr int kBacklog = 1024;
constexpr int kPortTries = 16;  // for a free port that all addresses of a host have

Error ListenError(const std::string& address, const std::string& why) {
  return {ErrorCode::kUnavailable, "cannot listen on " + address + " (" + why +
                                       "); stop what uses it or choose another with --listen"};
}

std::string SystemText() {
  return std::generic_category().message(errno);
}

using Addresses = std::unique_ptr<addrinfo, decltype(&freeaddrinfo)>;

void SetPort(sockaddr* address, uint16_t port) {
  if (address->sa_family == AF_INET6) {
    reinterpret_cast<sockaddr_in6*>(address)->sin6_port = htons(port);
  } else {
    reinterpret_cast<sockaddr_in*>(address)->sin_port = htons(port);
  }
}

uint16_t PortOf(int socket) {
  sockaddr_storage bound{};
  socklen_t size = sizeof bound;
  if (::getsockname(socket, reinterpret_cast<sockaddr*>(&bound), &size) != 0) return 0;
  return ntohs(bound.ss_family == AF_INET6 ? reinterpret_cast<sockaddr_in6&>(bound).sin6_port
                                           : reinterpret_cast<sockaddr_in&>(bound).sin_port);
}

// -1: errno says why not.
int Listen(int family, const sockaddr* address, socklen_t size) {
  const int socket = ::socket(family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (socket < 0) return -1;
  const int on = 1, off = 0;
  ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (family == AF_INET6) ::setsockopt(socket, IPPROTO_IPV6, IPV6_V6ONLY, &off, sizeof off);
  if (::bind(socket, address, size) == 0 && ::listen(socket, kBacklog) == 0) return socket;
  const int number = errno;
  ::close(socket);
  errno = number;
  return -1;
}

}  // namespace

ListeningSockets::ListeningSockets(ListeningSockets&& other) noexcept
    : sockets_(std::exchange(other.sockets_, {})),
      address_(std::move(other.address_)),
      path_(std::exchange(other.path_, {})),
      inode_(other.inode_) {}

void ListeningSockets::Close() {
  for (const int socket : std::exchange(sockets_, {})) ::close(socket);
  struct stat file{};
  const std::string path = std::exchange(path_, {});
  if (!path.empty() && ::lstat(path.c_str(), &file) == 0 && file.st_ino == inode_) ::unlink(path.c_str());
}

Result<void> ListeningSockets::OpenUnix(const std::string& path) {
  const std::string address = std::string(kUnixScheme) + path;
  if (const auto listener = ListenerOf(path))
    return ListenError(
        address, (*listener == 0 ? "another program" : "process " + std::to_string(*listener)) + " does");
  sockaddr_un to{};
  to.sun_family = AF_UNIX;
  if (path.size() >= sizeof to.sun_path)
    return ListenError(address, fmt::format("the path has {} bytes, at most {} are possible", path.size(),
                                            sizeof to.sun_path - 1));
  path.copy(to.sun_path, path.size());
  struct stat file{};
  if (::lstat(path.c_str(), &file) == 0 && S_ISSOCK(file.st_mode)) ::unlink(path.c_str());
  const int socket = Listen(AF_UNIX, reinterpret_cast<const sockaddr*>(&to), sizeof to);
  if (socket < 0) return ListenError(address, SystemText());
  sockets_ = {socket};
  address_ = address;
  path_ = path;
  if (::lstat(path.c_str(), &file) == 0) inode_ = file.st_ino;
  return {};
}

Result<void> ListeningSockets::OpenTcp(const HostPort& where) {
  const std::string host = where.host.find(':') == std::string::npos ? where.host : "[" + where.host + "]",
                    port = std::to_string(where.port), address = host + ":" + port;
  addrinfo hints{};
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (const int error = ::getaddrinfo(where.host.c_str(), port.c_str(), &hints, &found); error != 0)
    return ListenError(address, gai_strerror(error));
  const Addresses addresses(found, freeaddrinfo);
  const bool any_port = where.port == 0;
  for (int i = 0; i < kPortTries; ++i) {
    uint16_t chosen = 0;
    int failed = 0;
    for (addrinfo* one = found; one != nullptr; one = one->ai_next) {
      if (any_port) SetPort(one->ai_addr, chosen);
      const int socket = Listen(one->ai_family, one->ai_addr, one->ai_addrlen);
      if (socket < 0) {
        failed = errno;
        if (failed == EADDRINUSE) break;
        continue;  // such as IPv6 that is switched off
      }
      sockets_.push_back(socket);
      chosen = PortOf(socket);
    }
    if (failed != EADDRINUSE && !sockets_.empty()) {
      address_ = host + ":" + std::to_string(PortOf(sockets_.front()));
      return {};
    }
    Close();
    if (failed != EADDRINUSE || !any_port)
      return ListenError(address, std::generic_category().message(failed));
  }
  return ListenError(address, "no port is free on all addresses of the host");
}

Result<ListeningSockets> ListeningSockets::Open(const std::string& address) {
  ListeningSockets out;
  if (address.starts_with(kUnixScheme)) {
    const auto opened = out.OpenUnix(address.substr(kUnixScheme.size()));
    return opened ? Result<ListeningSockets>(std::move(out)) : opened.error();
  }
  const auto parsed = ParseHostPort(address);
  if (!parsed) return ListenError(address, parsed.error().message);
  const auto opened = out.OpenTcp(*parsed);
  return opened ? Result<ListeningSockets>(std::move(out)) : opened.error();
}

}  // namespace taclink::server
