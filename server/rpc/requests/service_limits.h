#pragma once

#include <grpcpp/server_builder.h>

#include <chrono>
#include <cstddef>

#include "server/config/options.h"
#include "server/listener/connection_table.h"

namespace taclink::server {

/// LimitsConfig, in the units that the services use.
struct ServiceLimits {
  ConnectionLimits connections = {};
  size_t max_streams = 64;
  size_t max_streams_per_peer = 16;
  size_t queue_messages = 256;
  size_t queue_bytes = size_t{32} << 20;
  size_t queue_bytes_per_peer = size_t{64} << 20;
  int max_calls_per_connection = 100;
  int max_message_bytes = 64 * 1024;
  size_t memory_bytes = size_t{256} << 20;
  std::chrono::milliseconds keepalive{60'000};
  std::chrono::milliseconds keepalive_timeout{120'000};
  std::chrono::milliseconds handshake_timeout{20'000};
  std::chrono::milliseconds idle_timeout{300'000};
};

ServiceLimits ToServiceLimits(const LimitsConfig& config);

/// What gRPC itself bounds: it refuses before any service sees the call.
void Apply(const ServiceLimits& limits, grpc::ServerBuilder& builder);

}  // namespace taclink::server
