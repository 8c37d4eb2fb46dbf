#include "server/rpc/rpc_server.h"

#include <google/protobuf/stubs/logging.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/server_builder.h>

#include <boost/system/system_error.hpp>
#include <string_view>
#include <utility>

#include "sensing/core/thread_start.h"
#include "server/process/unix_socket.h"
#include "server/rpc/credentials.h"

namespace taclink::server {
namespace {

// gRPC's plug-ins are global and must be set before the first builder.
void EnablePlugins() {
  static const bool once = [] {
    grpc::EnableDefaultHealthCheckService(true);
    // Every malformed request would write a line; the client is told.
    google::protobuf::SetLogHandler(nullptr);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    return true;
  }();
  static_cast<void>(once);
}

Result<void> CheckSocketIsFree(const std::string& listen) {
  constexpr std::string_view kUnixScheme = "unix:";
  if (!listen.starts_with(kUnixScheme)) return {};
  const auto listener = ListenerOf(listen.substr(kUnixScheme.size()));
  if (!listener) return {};
  const std::string who = *listener == 0 ? "another program" : "process " + std::to_string(*listener);
  return Error{ErrorCode::kUnavailable,
               "cannot listen on " + listen + ": " + who + " does; stop it or choose another with --listen"};
}

std::string WithPort(const std::string& listen, int port) {
  if (listen.starts_with("unix:")) return listen;
  return listen.substr(0, listen.rfind(':') + 1) + std::to_string(port);
}

}  // namespace

RpcServer::RpcServer(Arm& arm, ServiceLimits limits, const std::shared_ptr<const Security>& security,
                     Recorder* recorder)
    : senders_(std::make_shared<boost::asio::thread_pool>(1)),
      service_(arm, limits, senders_, security),
      operations_(arm, security),
      simulations_(arm) {
  if (recorder != nullptr)
    recordings_ = std::make_unique<RecordingService>(*recorder, service_.registry(), senders_, security);
}

Result<std::unique_ptr<RpcServer>> RpcServer::Start(const std::string& listen, Arm& arm, ServiceLimits limits,
                                                    std::shared_ptr<const Security> security,
                                                    Recorder* recorder) {
  if (const auto free = CheckSocketIsFree(listen); !free) return free.error();
  EnablePlugins();
  if (!security) security = std::make_shared<const Security>();
  std::unique_ptr<RpcServer> out;
  try {
    out.reset(new RpcServer(arm, limits, security, recorder));
  } catch (const boost::system::system_error& e) {  // of a pool
    return NoThread("the pools of gRPC's calls", e.code().message());
  }
  int port = 0;
  grpc::ServerBuilder builder;
  Apply(limits, builder);
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);  // else two servers share a port without a word
  builder.AddListeningPort(listen, MakeCredentials(listen, security), &port);
  builder.RegisterService(&out->service_);
  builder.RegisterService(&out->operations_);
  builder.RegisterService(&out->simulations_);
  if (recorder != nullptr) builder.RegisterService(out->recordings_.get());
  out->server_ = builder.BuildAndStart();
  if (!out->server_ || port == 0) {
    return Error{ErrorCode::kUnavailable,
                 "cannot listen on " + listen + "; stop what uses it or choose another with --listen"};
  }
  out->address_ = WithPort(listen, port);
  out->server_->GetHealthCheckService()->SetServingStatus(v1::TactileService::service_full_name(), true);
  out->server_->GetHealthCheckService()->SetServingStatus(v1::OperationsService::service_full_name(), true);
  out->server_->GetHealthCheckService()->SetServingStatus(v1::SimulationService::service_full_name(), true);
  if (recorder != nullptr)
    out->server_->GetHealthCheckService()->SetServingStatus(v1::RecordingService::service_full_name(), true);
  return out;
}

RpcServer::~RpcServer() {
  Shutdown("server is shutting down", std::chrono::milliseconds(0));
}

void RpcServer::Shutdown(const std::string& reason, std::chrono::milliseconds patience) {
  if (!server_) return;
  server_->GetHealthCheckService()->SetServingStatus(false);
  service_.EndStreams(reason);
  // Calls from within the process lose their last words once gRPC shuts down, so they get their time before.
  const auto deadline = std::chrono::system_clock::now() + patience;
  service_.WaitUntilNoStreams(patience);
  server_->Shutdown(deadline);
  server_->Wait();
  if (recordings_) recordings_->Join();
  service_.Join();
  senders_->join();
  server_.reset();
}

}  // namespace taclink::server
