#include "server/rpc/services/operations_service.h"

#include <spdlog/spdlog.h>

#include "server/replay/replay_link.h"
#include "server/rpc/requests/refusal.h"
#include "server/rpc/requests/request_check.h"
#include "server/rpc/requests/who.h"

namespace taclink::server {

grpc::ServerUnaryReactor* OperationsService::RestartLink(grpc::CallbackServerContext* context,
                                                         const v1::RestartLinkRequest* request,
                                                         v1::RestartLinkResponse*) {
  constexpr const char* kCall = "RestartLink";
  if (const auto good = CheckRequest(*request); !good) return RefuseCall(*context, kCall, good.error());
  const auto link = arm_.FindLink(request->link());
  if (!link) return RefuseCall(*context, kCall, link.error());
  if (arm_.plays_log()) return RefuseCall(*context, kCall, PlaysLog());
  SPDLOG_INFO("link {}: restart ordered by {}", request->link(), Who(*context, *security_));
  arm_.worker(*link).Restart();
  auto* reactor = context->DefaultReactor();
  reactor->Finish(grpc::Status::OK);
  return reactor;
}

grpc::ServerUnaryReactor* OperationsService::GetCaller(grpc::CallbackServerContext* context,
                                                       const v1::GetCallerRequest*,
                                                       v1::GetCallerResponse* response) {
  const Caller caller = CallerOf(*context, *security_);
  response->set_name(caller.name);
  response->set_role(static_cast<v1::Role>(static_cast<int>(caller.role) + 1));
  response->set_tokens(security_->needs_token());
  auto* reactor = context->DefaultReactor();
  reactor->Finish(grpc::Status::OK);
  return reactor;
}

}  // namespace taclink::server
