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

void AddPublisher(const PublishStatus& status, MetricsText& metrics) {
  const OutboxCounts& outbox = status.outbox;
  metrics.Gauge("taclink_publish_connected", "1 while a NATS server takes messages")
      .Value(status.connected && status.trouble.empty() ? 1 : 0);
  metrics.Counter("taclink_publish_acknowledged_total", "Messages that NATS has stored")
      .Value(static_cast<double>(outbox.acknowledged));
  metrics.Counter("taclink_publish_sent_again_total", "Messages that were sent once more")
      .Value(static_cast<double>(outbox.sent_again));
  metrics.Counter("taclink_publish_dropped_total", "Messages for which there was no room")
      .Value(static_cast<double>(outbox.frames_dropped), {{"kind", "frame"}})
      .Value(static_cast<double>(outbox.others_dropped), {{"kind", "event_or_contacts"}});
  metrics.Gauge("taclink_publish_waiting", "Messages that wait or are not acknowledged")
      .Value(static_cast<double>(outbox.waiting + outbox.in_flight));
  metrics.Gauge("taclink_publish_waiting_bytes", "Their size").Value(static_cast<double>(outbox.bytes));
}

}  // namespace

std::string MetricsOf(const Arm& arm, const RpcServer& server, const GatewayCounts& counts,
                      const Publisher* publisher) {
  MetricsText metrics;
  AddArmMetrics(arm, metrics);
  metrics.Gauge("taclink_streams", "Streams of clients that are open")
      .Value(static_cast<double>(server.streams()));
  metrics.Gauge("taclink_http_connections", "Open HTTP connections").Value(Number(counts.connections));
  metrics.Gauge("taclink_http_calls", "gRPC-Web calls under way").Value(Number(counts.calls));
  metrics.Counter("taclink_http_requests_total", "HTTP requests").Value(Number(counts.requests));
  metrics.Counter("taclink_http_connections_refused_total", "HTTP connections that were one too many")
      .Value(Number(counts.refused));
  if (publisher != nullptr) AddPublisher(publisher->Status(), metrics);
  AddProcessMetrics(metrics);
  return metrics.Text();
}

Result<std::unique_ptr<Gateway>> StartGateway(const HttpConfig& config, const Arm& arm, RpcServer& server,
                                              std::shared_ptr<const Security> security,
                                              const Publisher* publisher) {
  const std::string listen = config.listen.value_or(kDefaultHttpListen);
  if (listen.empty()) return std::unique_ptr<Gateway>();
  GatewayServices services{.channel = server.InProcessChannel(),
                           .security = std::move(security),
                           .readiness = [&arm] { return CheckReadiness(arm); },
                           .metrics = {}};
  services.metrics = [&arm, &server, publisher, counts = services.counts] {
    return MetricsOf(arm, server, *counts, publisher);
  };
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
