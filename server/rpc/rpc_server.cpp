#include "server/rpc/rpc_server.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/server_builder.h>

#include <utility>

namespace taclink::server {
namespace {

constexpr int kMaxRequestBytes = 64 * 1024;
// A client that vanished without a word is noticed after their sum; one that is only stopped for a minute or
// two is kept.
constexpr int kKeepaliveTimeMs = 60'000;
constexpr int kKeepaliveTimeoutMs = 120'000;

void SetUp(grpc::ServerBuilder& builder) {
  builder.SetMaxReceiveMessageSize(kMaxRequestBytes);
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);  // else two servers share a port without a word
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kKeepaliveTimeMs);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kKeepaliveTimeoutMs);
}

// gRPC's plug-ins are global and must be set before the first builder.
void EnablePlugins() {
  static const bool once = [] {
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    return true;
  }();
  static_cast<void>(once);
}

std::string WithPort(const std::string& listen, int port) {
  if (listen.starts_with("unix:")) return listen;
  return listen.substr(0, listen.rfind(':') + 1) + std::to_string(port);
}

}  // namespace

RpcServer::RpcServer(Arm& arm, ServiceLimits limits)
    : senders_(std::make_shared<boost::asio::thread_pool>(1)), service_(arm, limits, senders_) {}

Result<std::unique_ptr<RpcServer>> RpcServer::Start(const std::string& listen, Arm& arm,
                                                    ServiceLimits limits) {
  EnablePlugins();
  std::unique_ptr<RpcServer> out(new RpcServer(arm, limits));
  int port = 0;
  grpc::ServerBuilder builder;
  SetUp(builder);
  builder.AddListeningPort(listen, grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(&out->service_);
  out->server_ = builder.BuildAndStart();
  if (!out->server_ || port == 0) {
    return Error{ErrorCode::kUnavailable,
                 "cannot listen on " + listen + "; stop what uses it or choose another with --listen"};
  }
  out->address_ = WithPort(listen, port);
  out->server_->GetHealthCheckService()->SetServingStatus(v1::TactileService::service_full_name(), true);
  return out;
}

RpcServer::~RpcServer() {
  Shutdown("server is shutting down", std::chrono::milliseconds(0));
}

void RpcServer::Shutdown(const std::string& reason, std::chrono::milliseconds patience) {
  if (!server_) return;
  server_->GetHealthCheckService()->SetServingStatus(false);
  service_.EndStreams(reason);
  server_->Shutdown(std::chrono::system_clock::now() + patience);
  server_->Wait();
  senders_->join();
  server_.reset();
}

}  // namespace taclink::server
