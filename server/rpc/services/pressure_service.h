#pragma once

#include <memory>
#include <utility>

#include "server/arm/arm.h"
#include "server/security/security.h"
#include "taclink/v1/pressure.grpc.pb.h"

namespace taclink::server {

/// taclink.v1.PressureService over a running arm, which must outlive it.
class PressureService final
    : public v1::PressureService::WithCallbackMethod_SetPressure<
          v1::PressureService::WithCallbackMethod_GetPressure<v1::PressureService::Service>> {
 public:
  PressureService(Arm& arm, std::shared_ptr<const Security> security)
      : arm_(arm), security_(std::move(security)) {}

 private:
  grpc::ServerUnaryReactor* SetPressure(grpc::CallbackServerContext* context,
                                        const v1::SetPressureRequest* request,
                                        v1::SetPressureResponse* response) override;
  grpc::ServerUnaryReactor* GetPressure(grpc::CallbackServerContext* context,
                                        const v1::GetPressureRequest* request,
                                        v1::GetPressureResponse* response) override;

  Arm& arm_;
  const std::shared_ptr<const Security> security_;
};

}  // namespace taclink::server
