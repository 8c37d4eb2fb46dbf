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

void AddRecorder(const v1::RecorderStatus& status, MetricsText& metrics) {
  const bool in_trouble = status.state() == v1::RECORDER_STATE_TROUBLE;
  metrics.Gauge("taclink_recorder_recording", "1 while a recording is under way")
      .Value(in_trouble || status.state() == v1::RECORDER_STATE_RECORDING ? 1 : 0);
  metrics.Gauge("taclink_recorder_trouble", "1 while something is wrong with it").Value(in_trouble ? 1 : 0);
  metrics.Gauge("taclink_recorder_frames", "Frames in the logs of the last recording")
      .Value(static_cast<double>(status.frames()));
  metrics.Gauge("taclink_recorder_frames_lost", "Frames published during it that are not in its logs")
      .Value(static_cast<double>(status.frames_lost()));
  metrics.Gauge("taclink_recorder_last_trouble_timestamp_seconds", "When it was last in trouble; 0: never")
      .Value(static_cast<double>(status.last_trouble_utc_ns()) * 1e-9);
  metrics.Gauge("taclink_recorder_free_bytes", "Free space where logs are")
      .Value(static_cast<double>(status.free_bytes()));
}

void AddSecurity(const SecurityStatus& status, MetricsText& metrics) {
  metrics.Gauge("taclink_security_trouble", "1 while tokens or certificates can't be used as they are")
      .Value(status.trouble.empty() ? 0 : 1);
  metrics.Gauge("taclink_tokens", "Tokens that are known")
      .Value(static_cast<double>(status.tokens), {{"state", "good"}})
      .Value(static_cast<double>(status.expired), {{"state", "expired"}});
  metrics.Gauge("taclink_token_next_expiry_timestamp_seconds", "When the next token expires; 0: none does")
      .Value(static_cast<double>(status.next_expiry_utc_s.value_or(0)));
  metrics.Counter("taclink_failed_tries_total", "Calls that were refused for their token")
      .Value(static_cast<double>(status.tries_without), {{"token", "none"}})
      .Value(static_cast<double>(status.tries_unknown), {{"token", "unknown"}})
      .Value(static_cast<double>(status.tries_expired), {{"token", "expired"}});
  metrics
      .Counter("taclink_throttled_tries_total",
               "Of these, beyond what one address, or connection of gRPC, may try in a minute")
      .Value(static_cast<double>(status.tries_throttled));
}

}  // namespace

std::string MetricsOf(const Arm& arm, const RpcServer& server, const GatewayCounts& counts,
                      const Security& security, const Publisher* publisher) {
  MetricsText metrics;
  AddArmMetrics(arm, metrics);
  metrics.Gauge("taclink_streams", "Streams of clients that are open")
      .Value(static_cast<double>(server.streams()));
  const ListenerCounts& grpc = server.connections();
  metrics.Gauge("taclink_grpc_connections", "Open connections of gRPC").Value(Number(grpc.connections));
  metrics.Counter("taclink_grpc_connections_refused_total", "Connections of gRPC that were one too many")
      .Value(Number(grpc.refused));
  metrics.Counter("taclink_grpc_violations_total", "Connections that were closed for what they sent")
      .Value(Number(grpc.violations));
  metrics.Gauge("taclink_http_connections", "Open HTTP connections").Value(Number(counts.connections));
  metrics.Gauge("taclink_http_calls", "gRPC-Web calls under way").Value(Number(counts.calls));
  metrics.Counter("taclink_http_requests_total", "HTTP requests").Value(Number(counts.requests));
  metrics.Counter("taclink_http_connections_refused_total", "HTTP connections that were one too many")
      .Value(Number(counts.refused));
  if (const Recorder* recorder = server.recorder()) AddRecorder(recorder->Status(), metrics);
  if (publisher != nullptr) AddPublisher(publisher->Status(), metrics);
  AddSecurity(security.Status(), metrics);
  AddProcessMetrics(metrics);
  return metrics.Text();
}

Result<std::unique_ptr<Gateway>> StartGateway(const HttpConfig& config, const Arm& arm, RpcServer& server,
                                              const std::shared_ptr<const Security>& security,
                                              const Publisher* publisher) {
  const std::string listen = config.listen.value_or(kDefaultHttpListen);
  if (listen.empty()) return std::unique_ptr<Gateway>();
  GatewayServices services{.channel = server.InProcessChannel(),
                           .security = security,
                           .readiness = [&arm, security] { return CheckReadiness(arm, *security); },
                           .metrics = {}};
  services.metrics = [&arm, &server, publisher, security, counts = services.counts] {
    return MetricsOf(arm, server, *counts, *security, publisher);
  };
  const bool encrypted = services.security->tls() != nullptr;
  auto gateway =
      Gateway::Start({.listen = listen,
                      .web_root = config.web_root,
                      .max_connections = static_cast<size_t>(config.max_connections),
                      .max_connections_per_peer = static_cast<size_t>(config.max_connections_per_peer),
                      .header_timeout = Milliseconds(config.header_timeout_s),
                      .idle_timeout = Milliseconds(config.idle_timeout_s),
                      .write_timeout = Milliseconds(config.write_timeout_s)},
                     std::move(services));
  if (!gateway && !config.listen && gateway.error().code == ErrorCode::kUnavailable) {
    SPDLOG_WARN("no web page: {}", gateway.error().message);
    return std::unique_ptr<Gateway>();
  }
  if (!gateway) return gateway.error();
  SPDLOG_INFO("web page at {}://{}", encrypted ? "https" : "http", (*gateway)->address());
  return gateway;
}

}  // namespace taclink::server
