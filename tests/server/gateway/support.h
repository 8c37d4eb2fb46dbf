#pragma once

#include <memory>
#include <string>
#include <utility>

#include "server/gateway/readiness.h"
#include "server/gateway/setup.h"
#include "tests/integration/support.h"
#include "tests/server/gateway/raw_http.h"

namespace taclink::server {

/// A gateway on a free port before a TestServer.
class TestGateway {
 public:
  explicit TestGateway(GatewayOptions options = {},
                       const std::shared_ptr<const Security>& security = std::make_shared<const Security>(),
                       const RecordingConfig& recording = {})
      : server_(std::make_unique<TestServer>(TestLimits(), nullptr, TestServer::MakePressure(), recording)) {
    options.listen = "127.0.0.1:0";
    GatewayServices services{
        .channel = server_->server().InProcessChannel(),
        .security = security,
        .readiness = [this, security] { return CheckReadiness(server_->arm(), *security); },
        .metrics = {}};
    counts_ = services.counts;
    services.metrics = [this, security] {
      return MetricsOf(server_->arm(), server_->server(), *counts_, *security);
    };
    auto gateway = Gateway::Start(std::move(options), std::move(services));
    EXPECT_TRUE(gateway.ok()) << gateway.error().message;
    gateway_ = std::move(*gateway);
  }

  TestServer& server() { return *server_; }
  Gateway& gateway() { return *gateway_; }
  const std::string& address() const { return gateway_->address(); }
  const GatewayCounts& counts() const { return *counts_; }

 private:
  const std::unique_ptr<TestServer> server_;
  std::shared_ptr<GatewayCounts> counts_;
  std::unique_ptr<Gateway> gateway_;  // ends before the server
};

}  // namespace taclink::server
