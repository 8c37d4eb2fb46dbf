#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "sensing/core/result.h"
#include "server/listener/connection_table.h"
#include "server/listener/http2_inspector.h"
#include "server/process/shared_socket.h"

namespace taclink::server {

class AcceptLoop;

struct ListenerOptions {
  std::string address;  ///< host:port, [ip6]:port (port 0: any free one) or unix:path
  bool has_tls = false;
  std::chrono::milliseconds user_timeout{120'000};  ///< sent, but not acknowledged for so long: it is lost
  ConnectionLimits connections = {};
  Http2Limits http2 = {};
};

struct ListenerCounts {
  std::atomic<uint64_t> connections = 0;  ///< now
  std::atomic<uint64_t> refused = 0;      ///< one too many, or gave way to another, since the start
  std::atomic<uint64_t> violations = 0;   ///< ended because of what the client sent, since the start
};

/// Accepts gRPC's connections in its place and hands them over: bounds their number for all and for each
/// address, keeps descriptors for the server itself, has what they send inspected, and bounds what waits in
/// the kernel to be sent. gRPC accepts whatever comes, and in version 1.51 stops for good where a descriptor
/// is missing. A thread of its own.
class Listener {
 public:
  /// Takes over the descriptor; called on the listener's thread.
  using HandOver = std::function<void(int fd)>;

  /// Listens at once, on all addresses of the host; connections wait in the kernel. Errors: kUnavailable (the
  /// address is in use or unknown), kResourceExhausted (too few descriptors).
  static Result<std::unique_ptr<Listener>> Open(const ListenerOptions& options);
  ~Listener();

  /// Hands connections over from now on. Once. Errors: kResourceExhausted (no thread can be started).
  Result<void> Begin(HandOver hand_over);
  /// Takes no more connections: none is handed over once it returns. Those that were stay, and are inspected.
  /// May be called twice.
  void Close();

  /// Where it listens, with the real port.
  const std::string& address() const;
  const ListenerCounts& counts() const;
  /// An authorized call came from `peer` (gRPC's text of it): its connection does not give way to others.
  /// Any thread.
  void MarkAuthorized(const std::string& peer);
  /// The socket of the connection from `peer`. Null: it has ended, or it is one of a unix socket. Any thread.
  std::shared_ptr<const SharedSocket> SocketOf(const std::string& peer) const;

 private:
  explicit Listener(std::shared_ptr<AcceptLoop> loop);

  const std::shared_ptr<AcceptLoop> loop_;
};

}  // namespace taclink::server
