#include "server/rpc/requests/service_limits.h"

#include <grpcpp/resource_quota.h>

namespace taclink::server {

using std::chrono::milliseconds;
using std::chrono::seconds;

namespace {
// Clients that ask more often whether this server is still there are cut off; ours ask every 10 s.
constexpr milliseconds kLeastPingInterval{5000};
}  // namespace

ServiceLimits ToServiceLimits(const LimitsConfig& config) {
  const auto size = [](int value) { return static_cast<size_t>(value); };
  return {.connections = {.all = size(config.max_connections),
                          .per_place = size(config.max_connections_per_peer)},
          .max_streams = size(config.max_streams),
          .max_streams_per_peer = size(config.max_streams_per_peer),
          .queue_messages = size(config.queue_messages),
          .queue_bytes = size(config.queue_mb) << 20,
          .queue_bytes_per_peer = size(config.queue_mb_per_peer) << 20,
          .max_calls_per_connection = config.max_calls_per_connection,
          .max_message_bytes = config.max_message_kb * 1024,
          .memory_bytes = size(config.memory_mb) << 20,
          .keepalive = seconds(config.keepalive_s),
          .keepalive_timeout = seconds(config.keepalive_timeout_s),
          .handshake_timeout = seconds(config.handshake_timeout_s),
          .idle_timeout = seconds(config.idle_timeout_s)};
}

void Apply(const ServiceLimits& limits, grpc::ServerBuilder& builder) {
  const auto set = [&builder](const char* name, milliseconds time) {
    builder.AddChannelArgument(name, static_cast<int>(time.count()));
  };
  builder.SetMaxReceiveMessageSize(limits.max_message_bytes);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, limits.max_calls_per_connection);
  builder.SetResourceQuota(grpc::ResourceQuota("taclinkd").Resize(limits.memory_bytes));
  // A client that vanished without a word is noticed after the sum of the first two.
  set(GRPC_ARG_KEEPALIVE_TIME_MS, limits.keepalive);
  set(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, limits.keepalive_timeout);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  set(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, kLeastPingInterval);
  set(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, limits.handshake_timeout);
  set(GRPC_ARG_MAX_CONNECTION_IDLE_MS, limits.idle_timeout);
}

}  // namespace taclink::server
