#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <unordered_map>

#include "server/listener/http2_inspector.h"

namespace taclink::server {

/// A connection whose bytes are inspected as gRPC reads them. Fed by one of gRPC's threads at a time.
class GuardedConnection {
 public:
  /// `on_violation` is called once, by the thread that reads.
  GuardedConnection(const Http2Limits& limits, std::function<void(const std::string& why)> on_violation)
      : inspector_(limits), on_violation_(std::move(on_violation)) {}

  /// False: the connection must end.
  bool Feed(std::span<const std::byte> bytes);
  /// An authorized call came over it: fewer limits apply. Any thread.
  void MarkAuthorized() { authorized_ = true; }

 private:
  std::atomic<bool> authorized_ = false;
  Http2Inspector inspector_;
  std::function<void(const std::string& why)> on_violation_;  // empty: was called
};

/// Sees what gRPC reads from its connections, as plain text, and can end them. gRPC has no place for that,
/// and a proxy in front of it would cost each message two copies and a thread switch. So this program has a
/// recvmsg and an SSL_read of its own, which gRPC's library calls in place of those of the C library and of
/// OpenSSL. They do what these do, for all callers, and then show the bytes of guarded connections to their
/// inspector. One object for the process.
class ReadGuard {
 public:
  static ReadGuard& Instance();

  /// A connection without TLS, until Forget. Known by its descriptor and by the socket behind it, because
  /// gRPC may close the descriptor, and another file take its number, at any time.
  void GuardPlain(int fd, std::shared_ptr<GuardedConnection> connection);
  void Forget(int fd, const GuardedConnection* connection);
  /// For the life of the object each SSL that this thread makes is the connection's: gRPC makes it while it
  /// is handed the connection.
  class TlsScope {
   public:
    explicit TlsScope(std::shared_ptr<GuardedConnection> connection);
    ~TlsScope();
    TlsScope(const TlsScope&) = delete;
    TlsScope& operator=(const TlsScope&) = delete;
  };

  /// Null: not guarded.
  std::shared_ptr<GuardedConnection> Find(int fd);

 private:
  struct Plain {
    uint64_t cookie = 0;  // of the socket (SO_COOKIE)
    std::shared_ptr<GuardedConnection> connection;
  };

  std::mutex mutex_;
  std::unordered_map<int, Plain> plain_;  // guarded by mutex_
};

}  // namespace taclink::server
