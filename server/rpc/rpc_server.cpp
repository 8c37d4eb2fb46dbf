#include "server/rpc/rpc_server.h"

#include <google/protobuf/stubs/logging.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/server_builder.h>
#include <grpcpp/support/server_interceptor.h>

#include <boost/system/system_error.hpp>
#include <functional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sensing/core/thread_start.h"
#include "server/rpc/credentials.h"
#include "server/security/access.h"

namespace taclink::server {
namespace {

// gRPC's plug-ins are global and must be set before the first builder.
void EnablePlugins() {
  static const bool once = [] {
    // Every malformed request would write a line; the client is told.
    google::protobuf::SetLogHandler(nullptr);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    return true;
  }();
  static_cast<void>(once);
}

/// Sees each call that has passed the check of its token (credentials.cpp). Intercepts nothing.
class CallObserver final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  CallObserver(bool needs_token, std::function<void(const std::string& peer)> on_call)
      : needs_token_(needs_token), on_call_(std::move(on_call)) {}

  grpc::experimental::Interceptor* CreateServerInterceptor(grpc::experimental::ServerRpcInfo* call) override {
    // A call that needs no token authorizes no connection where others need one.
    if (!needs_token_ || NeededRole(call->method()) != Role::kNobody)
      on_call_(call->server_context()->peer());
    return nullptr;
  }

 private:
  const bool needs_token_;
  const std::function<void(const std::string& peer)> on_call_;
};

std::set<std::string> ServiceNames(bool records) {
  std::set<std::string> names = {
      v1::TactileService::service_full_name(), v1::OperationsService::service_full_name(),
      v1::PressureService::service_full_name(), v1::SimulationService::service_full_name(),
      v1::AcceptanceService::service_full_name()};
  if (records) names.insert(v1::RecordingService::service_full_name());
  return names;
}

}  // namespace

RpcServer::RpcServer(Arm& arm, ServiceLimits limits, const std::shared_ptr<const Security>& security,
                     Recorder* recorder)
    : senders_(std::make_shared<boost::asio::thread_pool>(1)),
      service_(arm, limits, senders_, security),
      operations_(arm, security),
      pressures_(arm, security),
      simulations_(arm),
      acceptances_(arm, security),
      health_(ServiceNames(recorder != nullptr), senders_, security) {
  if (recorder != nullptr)
    recordings_ = std::make_unique<RecordingService>(*recorder, service_.registry(), senders_, security);
}

Result<std::unique_ptr<RpcServer>> RpcServer::Start(const std::string& listen, Arm& arm, ServiceLimits limits,
                                                    std::shared_ptr<const Security> security,
                                                    Recorder* recorder) {
  EnablePlugins();
  if (!security) security = std::make_shared<const Security>();
  std::unique_ptr<RpcServer> out;
  try {
    out.reset(new RpcServer(arm, limits, security, recorder));
  } catch (const boost::system::system_error& e) {  // of a pool
    return NoThread("the pools of gRPC's calls", e.code().message());
  }
  auto listener = Listener::Open({.address = listen,
                                  .has_tls = HasTls(listen, *security),
                                  .user_timeout = limits.keepalive_timeout,
                                  .connections = limits.connections});
  if (!listener) return listener.error();
  out->service_.registry().SetSockets(
      [listener = listener->get()](const std::string& peer) { return listener->SocketOf(peer); });
  grpc::ServerBuilder builder;
  Apply(limits, builder);
  std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> observers;
  observers.push_back(std::make_unique<CallObserver>(
      security->needs_token(),
      [listener = listener->get()](const std::string& peer) { listener->MarkAuthorized(peer); }));
  builder.experimental().SetInterceptorCreators(std::move(observers));
  using Connections = grpc::ServerBuilder::experimental_type::ExternalConnectionType;
  out->acceptor_ = builder.experimental().AddExternalConnectionAcceptor(Connections::FROM_FD,
                                                                        MakeCredentials(listen, security));
  builder.RegisterService(&out->service_);
  builder.RegisterService(&out->operations_);
  builder.RegisterService(&out->pressures_);
  builder.RegisterService(&out->simulations_);
  builder.RegisterService(&out->acceptances_);
  builder.RegisterService(&out->health_);
  if (recorder != nullptr) builder.RegisterService(out->recordings_.get());
  out->listener_ = std::move(*listener);
  out->server_ = builder.BuildAndStart();
  if (!out->server_) return Error{ErrorCode::kUnavailable, "gRPC cannot be started"};
  const auto begun = out->listener_->Begin([acceptor = out->acceptor_.get()](int fd) {
    grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters connection;
    connection.fd = fd;
    acceptor->HandleNewConnection(&connection);
  });
  if (!begun) return begun.error();
  return out;
}

RpcServer::~RpcServer() {
  Shutdown("server is shutting down", std::chrono::milliseconds(0));
}

void RpcServer::Shutdown(const std::string& reason, std::chrono::milliseconds patience) {
  if (!server_) return;
  listener_->Close();
  health_.Stop(reason);
  service_.EndStreams(reason);
  acceptances_.EndCalls(reason);
  // Calls from within the process lose their last words once gRPC shuts down, so they get their time before.
  const auto deadline = std::chrono::system_clock::now() + patience;
  service_.WaitUntilNoStreams(patience);
  server_->Shutdown(deadline);
  server_->Wait();
  if (recordings_) recordings_->Join();
  service_.Join();
  acceptances_.Join();
  senders_->join();
  server_.reset();
}

}  // namespace taclink::server
