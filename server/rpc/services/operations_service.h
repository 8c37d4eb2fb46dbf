#pragma once

#include <memory>
#include <utility>

#include "server/arm/arm.h"
#include "server/security/security.h"
#include "taclink/v1/operations.grpc.pb.h"

namespace taclink::server {

/// taclink.v1.OperationsService over a running arm, which must outlive it.
class OperationsService final
    : public v1::OperationsService::WithCallbackMethod_RestartLink<
          v1::OperationsService::WithCallbackMethod_GetCaller<v1::OperationsService::Service>> {
 public:
  OperationsService(Arm& arm, std::shared_ptr<const Security> security)
      : arm_(arm), security_(std::move(security)) {}

 private:
  grpc::ServerUnaryReactor* RestartLink(grpc::CallbackServerContext* context,
                                        const v1::RestartLinkRequest* request,
                                        v1::RestartLinkResponse* response) override;

  grpc::ServerUnaryReactor* GetCaller(grpc::CallbackServerContext* context,
                                      const v1::GetCallerRequest* request,
                                      v1::GetCallerResponse* response) override;

  // Constant after construction.
  Arm& arm_;
  const std::shared_ptr<const Security> security_;
};

}  // namespace taclink::server
