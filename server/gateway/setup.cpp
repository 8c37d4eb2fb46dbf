#include "server/gateway/setup.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "server/gateway/arm_metrics.h"
#include "server/gateway/process_metrics.h"
#include "server/gateway/readiness.h"

namespace taclink::server {
namespace {

std::chrono::milliseconds Milliseconds(double seconds) {
  return std::chrono::milliseconds(static_cast<int64_t>(seconds * 1e3));
}

double Number(const std::atomic<uint64_t>& count) {
  return static_cast<double>(count.load());
}

}  // namespace

std::string MetricsOf(const Arm& arm, const RpcServer& server, const GatewayCounts& counts) {
  MetricsText metrics;
  AddArmMetrics(arm, metrics);
  metrics.Gauge("taclink_streams", "Streams of clients that are open")
      .Value(static_cast<double>(server.streams()));
  metrics.Gauge("taclink_http_connections", "Open HTTP connections").Value(Number(counts.connections));
  metrics.Gauge("taclink_http_calls", "gRPC-Web calls under way").Value(Number(counts.calls));
  metrics.Counter("taclink_http_requests_total", "HTTP requests").Value(Number(counts.requests));
  metrics.Counter("taclink_http_connections_refused_total", "HTTP connections that were one too many")
      .Value(Number(counts.refused));
  AddProcessMetrics(metrics);
  return metrics.Text();
}

Result<std::unique_ptr<Gateway>> StartGateway(const HttpConfig& config, const Arm& arm, RpcServer& server,
                                              std::shared_ptr<const Security> security) {
  const std::string listen = config.listen.value_or(kDefaultHttpListen);
  if (listen.empty()) return std::unique_ptr<Gateway>();
  GatewayServices services{.channel = server.InProcessChannel(),
                           .security = std::move(security),
                           .readiness = [&arm] { return CheckReadiness(arm); },
                           .metrics = {}};
  services.metrics = [&arm, &server, counts = services.counts] { return MetricsOf(arm, server, *counts); };
  const bool encrypted = services.security->tls() != nullptr;
  auto gateway = Gateway::Start({.listen = listen,
                                 .web_root = config.web_root,
                                 .max_connections = static_cast<size_t>(config.max_connections),
                                 .header_timeout = Milliseconds(config.header_timeout_s),
                                 .idle_timeout = Milliseconds(config.idle_timeout_s),
                                 .write_timeout = Milliseconds(config.write_timeout_s)},
                                std::move(services));
  if (!gateway && !config.listen && gateway.error().code == ErrorCode::kUnavailable) {
    spdlog::warn("no web page: {}", gateway.error().message);
    return std::unique_ptr<Gateway>();
  }
  if (!gateway) return gateway.error();
  spdlog::info("web page at {}://{}", encrypted ? "https" : "http", (*gateway)->address());
  return gateway;
}

}  // namespace taclink::server
