#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "sensing/core/result.h"
#include "server/gateway/http_message.h"
#include "server/security/security.h"

namespace grpc {
class Channel;
}

namespace taclink::server {

struct GatewayOptions {
  std::string listen = {};               ///< host:port or [ip6]:port; port 0: any free one
  std::string web_root = {};             ///< folder of the web page; empty: the one built in
  size_t max_connections = 128;          ///< a quarter is kept for this machine
  size_t max_connections_per_peer = 32;  ///< of one address
  std::chrono::milliseconds header_timeout{10'000};
  std::chrono::milliseconds idle_timeout{60'000};
  std::chrono::milliseconds write_timeout{120'000};
  HttpLimits http = {};
};

/// What /readyz tells.
struct Readiness {
  bool ready = false;
  std::string text;  ///< why, line by line
};

struct GatewayCounts {
  std::atomic<uint64_t> connections = 0;  ///< now
  std::atomic<uint64_t> calls = 0;        ///< gRPC-Web calls now
  std::atomic<uint64_t> requests = 0;     ///< since the start
  std::atomic<uint64_t> refused = 0;      ///< connections that were one too many, since the start
};

/// What the gateway hands requests on to. Functions are called on the gateway's thread.
struct GatewayServices {
  std::shared_ptr<grpc::Channel> channel = {};  ///< of gRPC-Web calls; skips gRPC's own checks of the caller
  std::shared_ptr<const Security> security = {};
  std::function<Readiness()> readiness = {};
  std::function<std::string()> metrics = {};  ///< Prometheus' text format
  std::shared_ptr<GatewayCounts> counts = std::make_shared<GatewayCounts>();
};

/// HTTP for browsers and monitors: static files, gRPC-Web, /healthz, /readyz, /metrics. One thread of its
/// own.
class Gateway {
 public:
  /// Listens at once. Errors: kUnavailable (the address can't be had), kNotFound (web_root).
  static Result<std::unique_ptr<Gateway>> Start(GatewayOptions options, GatewayServices services);
  /// Ends all connections.
  ~Gateway();

  /// Takes no more connections or requests; calls under way go on.
  void Drain();
  /// Where it listens, with the real port.
  const std::string& address() const;

 private:
  struct Running;
  explicit Gateway(std::unique_ptr<Running> running);

  const std::unique_ptr<Running> running_;
};

}  // namespace taclink::server
