#include "server/process/unix_socket.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>

namespace taclink::server {

std::optional<pid_t> ListenerOf(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) return std::nullopt;
  path.copy(address.sun_path, path.size());
  const int socket = ::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (socket < 0) return std::nullopt;
  const int connected = ::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof(address));
  const bool listens = connected == 0 || errno == EAGAIN;  // so many wait already
  ucred peer{};
  socklen_t size = sizeof(peer);
  if (connected != 0 || ::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) peer.pid = 0;
  ::close(socket);
  return listens ? std::optional(peer.pid) : std::nullopt;
}

}  // namespace taclink::server
