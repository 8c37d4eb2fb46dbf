#pragma once

#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>

#include <boost/asio/thread_pool.hpp>
#include <chrono>
#include <memory>
#include <string>

#include "sensing/core/result.h"
#include "server/arm/arm.h"
#include "server/listener/listener.h"
#include "server/rpc/services/acceptance_service.h"
#include "server/rpc/services/health_service.h"
#include "server/rpc/services/operations_service.h"
#include "server/rpc/services/pressure_service.h"
#include "server/rpc/services/recording_service.h"
#include "server/rpc/services/simulation_service.h"
#include "server/rpc/services/tactile_service.h"
#include "server/security/security.h"

namespace taclink::server {

/// gRPC over one arm: TactileService, OperationsService, PressureService, SimulationService,
/// AcceptanceService, RecordingService, health, reflection. The arm must outlive it.
class RpcServer {
 public:
  /// Listens at once. `security` null: everybody may call, in the clear. `recorder` null: no
  /// RecordingService; otherwise it must outlive the server. Errors: kUnavailable (the address can't be had).
  static Result<std::unique_ptr<RpcServer>> Start(const std::string& listen, Arm& arm, ServiceLimits limits,
                                                  std::shared_ptr<const Security> security = nullptr,
                                                  Recorder* recorder = nullptr);
  ~RpcServer();

  /// Tells every stream why, then ends all calls by `patience` at the latest. May be called twice.
  void Shutdown(const std::string& reason, std::chrono::milliseconds patience);

  /// Where it listens, with the real port.
  const std::string& address() const { return listener_->address(); }
  /// For calls from within this process.
  std::shared_ptr<grpc::Channel> InProcessChannel() { return server_->InProcessChannel({}); }
  /// Null: there is none.
  const Recorder* recorder() const { return recordings_ ? &recordings_->recorder() : nullptr; }
  size_t streams() const { return service_.streams(); }
  const ListenerCounts& connections() const { return listener_->counts(); }
  void SetLimits(ServiceLimits limits) { service_.SetLimits(limits); }

 private:
  RpcServer(Arm& arm, ServiceLimits limits, const std::shared_ptr<const Security>& security,
            Recorder* recorder);

  // Constant after Start. The service outlives the server that calls it.
  const std::shared_ptr<boost::asio::thread_pool> senders_;
  TactileService service_;
  OperationsService operations_;
  PressureService pressures_;
  SimulationService simulations_;
  AcceptanceService acceptances_;
  std::unique_ptr<RecordingService> recordings_;                              // null: none
  std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> acceptor_;  // of the listener's connections
  std::unique_ptr<Listener> listener_;
  HealthService health_;
  std::unique_ptr<grpc::Server> server_;
};

}  // namespace taclink::server
