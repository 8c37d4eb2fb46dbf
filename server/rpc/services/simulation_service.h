#pragma once

#include <memory>
#include <utility>

#include "server/arm/arm.h"
#include "server/security/security.h"
#include "taclink/v1/simulation.grpc.pb.h"

namespace taclink::server {

/// taclink.v1.SimulationService over a running arm, which must outlive it.
class SimulationService final : public v1::SimulationService::WithCallbackMethod_Press<
                                    v1::SimulationService::WithCallbackMethod_Release<
                                        v1::SimulationService::WithCallbackMethod_SetScenePressure<
                                            v1::SimulationService::WithCallbackMethod_MoveSceneJoint<
                                                v1::SimulationService::Service>>>> {
 public:
  explicit SimulationService(Arm& arm) : arm_(arm) {}

 private:
  grpc::ServerUnaryReactor* Press(grpc::CallbackServerContext* context, const v1::PressRequest* request,
                                  v1::PressResponse* response) override;
  grpc::ServerUnaryReactor* Release(grpc::CallbackServerContext* context, const v1::ReleaseRequest* request,
                                    v1::ReleaseResponse* response) override;
  grpc::ServerUnaryReactor* SetScenePressure(grpc::CallbackServerContext* context,
                                             const v1::SetScenePressureRequest* request,
                                             v1::SetScenePressureResponse* response) override;
  grpc::ServerUnaryReactor* MoveSceneJoint(grpc::CallbackServerContext* context,
                                           const v1::MoveSceneJointRequest* request,
                                           v1::MoveSceneJointResponse* response) override;

  template <typename Request, typename Change>
  grpc::ServerUnaryReactor* Do(grpc::CallbackServerContext* context, const char* call, const Request& request,
                               Change change);

  Arm& arm_;
};

}  // namespace taclink::server
