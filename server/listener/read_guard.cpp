#include "server/listener/read_guard.h"

#include <dlfcn.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "sensing/core/clock.h"

namespace taclink::server {
namespace {

thread_local std::shared_ptr<GuardedConnection> tls_connection;  // of the TlsScope

uint64_t CookieOf(int fd) {
  uint64_t cookie = 0;
  socklen_t size = sizeof cookie;
  return ::getsockopt(fd, SOL_SOCKET, SO_COOKIE, &cookie, &size) == 0 ? cookie : 0;
}

using Holder = std::shared_ptr<GuardedConnection>;

// Called by OpenSSL for each new SSL, by the thread that makes it.
void AttachConnection(void*, void*, CRYPTO_EX_DATA* data, int index, long, void*) {
  if (tls_connection) CRYPTO_set_ex_data(data, index, new Holder(tls_connection));
}

void DetachConnection(void*, void* held, CRYPTO_EX_DATA*, int, long, void*) {
  delete static_cast<Holder*>(held);
}

int ConnectionIndex() {
  static const int kIndex = SSL_get_ex_new_index(0, nullptr, AttachConnection, nullptr, DetachConnection);
  return kIndex;
}

}  // namespace

bool GuardedConnection::Feed(std::span<const std::byte> bytes) {
  if (inspector_.Feed(bytes, SystemClock().MonotonicNs(), authorized_)) return true;
  if (const auto tell = std::exchange(on_violation_, nullptr)) tell(inspector_.violation());
  return false;
}

ReadGuard& ReadGuard::Instance() {
  static auto* const kGuard = new ReadGuard;  // gRPC's threads may outlive static objects
  return *kGuard;
}

void ReadGuard::GuardPlain(int fd, std::shared_ptr<GuardedConnection> connection) {
  const uint64_t cookie = CookieOf(fd);
  const std::lock_guard lock(mutex_);
  plain_[fd] = {.cookie = cookie, .connection = std::move(connection)};
}

void ReadGuard::Forget(int fd, const GuardedConnection* connection) {
  const std::lock_guard lock(mutex_);
  const auto at = plain_.find(fd);
  if (at != plain_.end() && at->second.connection.get() == connection) plain_.erase(at);
}

std::shared_ptr<GuardedConnection> ReadGuard::Find(int fd) {
  Plain found;
  {
    const std::lock_guard lock(mutex_);
    const auto at = plain_.find(fd);
    if (at == plain_.end()) return nullptr;
    found = at->second;
  }
  return CookieOf(fd) == found.cookie ? found.connection : nullptr;
}

ReadGuard::TlsScope::TlsScope(std::shared_ptr<GuardedConnection> connection) {
  static_cast<void>(ConnectionIndex());
  tls_connection = std::move(connection);
}

ReadGuard::TlsScope::~TlsScope() {
  tls_connection.reset();
}

}  // namespace taclink::server

// NOLINTBEGIN(readability-identifier-naming): the names are those of the libraries.

extern "C" ssize_t recvmsg(int fd, msghdr* message, int flags) {
  const auto received = static_cast<ssize_t>(::syscall(SYS_recvmsg, fd, message, flags));
  if (received <= 0 || (flags & (MSG_PEEK | MSG_ERRQUEUE)) != 0) return received;
  const auto connection = taclink::server::ReadGuard::Instance().Find(fd);
  if (!connection) return received;
  auto left = static_cast<size_t>(received);
  for (size_t i = 0; i < message->msg_iovlen && left > 0; ++i) {
    const size_t size = std::min(left, message->msg_iov[i].iov_len);
    left -= size;
    if (connection->Feed({static_cast<const std::byte*>(message->msg_iov[i].iov_base), size})) continue;
    errno = ECONNRESET;
    return -1;
  }
  return received;
}

extern "C" int SSL_read(SSL* ssl, void* buffer, int size) {
  static const auto read = reinterpret_cast<int (*)(SSL*, void*, int)>(::dlsym(RTLD_NEXT, "SSL_read"));
  const int received = read(ssl, buffer, size);
  if (received <= 0) return received;
  const auto* const held = static_cast<const std::shared_ptr<taclink::server::GuardedConnection>*>(
      SSL_get_ex_data(ssl, taclink::server::ConnectionIndex()));
  if (held == nullptr ||
      (*held)->Feed({static_cast<const std::byte*>(buffer), static_cast<size_t>(received)}))
    return received;
  ERR_raise(ERR_LIB_USER, ERR_R_OPERATION_FAIL);  // SSL_get_error then tells of a failed connection
  return -1;
}

// NOLINTEND(readability-identifier-naming)
