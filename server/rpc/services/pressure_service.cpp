#include "server/rpc/services/pressure_service.h"

#include <spdlog/spdlog.h>

#include <string>

#include "server/messages/pressure_message.h"
#include "server/pressure/pressure_controller.h"
#include "server/rpc/requests/refusal.h"
#include "server/rpc/requests/request_check.h"
#include "server/rpc/requests/who.h"
#include "server/rpc/services/link_calls.h"

namespace taclink::server {
namespace {

constexpr double kKpaPerPascal = 1e-3;

Result<PressureOrder> ParseOrder(const v1::SetPressureRequest& request) {
  PressureOrder order{.reset_trip = request.reset_trip()};
  switch (request.goal_case()) {
    case v1::SetPressureRequest::kPressurePa:
      order.kpa = kKpaPerPascal * request.pressure_pa();
      break;
    case v1::SetPressureRequest::kVent:
      if (!request.vent())
        return Error{ErrorCode::kInvalidArgument, "vent must be true; for a new setpoint give pressure_pa"};
      break;
    case v1::SetPressureRequest::GOAL_NOT_SET:
      return Error{ErrorCode::kInvalidArgument, "neither pressure_pa nor vent is given"};
  }
  if (request.has_ramp_pa_per_s()) order.ramp_kpa_per_s = kKpaPerPascal * request.ramp_pa_per_s();
  return order;
}

// For the audit.
Operation ToOperation(const v1::SetPressureRequest& request, const Result<PressureOrderResult>& end,
                      std::string who) {
  Operation operation{.who = std::move(who), .accepted = end.ok(), .outcome = {}, .values = {}};
  const std::string what = request.has_vent() ? "vent" : "setpoint";
  operation.outcome = "link " + request.link() + ": " + (end ? what : what + ": " + end.error().message);
  if (request.has_pressure_pa()) operation.values["pressure_pa"] = request.pressure_pa();
  if (request.has_ramp_pa_per_s()) operation.values["ramp_pa_per_s"] = request.ramp_pa_per_s();
  return operation;
}

Result<PressureController*> FindRegulator(const Arm& arm, const std::string& name) {
  const auto link = FindLiveLink(arm, name);
  if (!link) return link.error();
  return arm.regulator(*link);
}

}  // namespace

grpc::ServerUnaryReactor* PressureService::SetPressure(grpc::CallbackServerContext* context,
                                                       const v1::SetPressureRequest* request,
                                                       v1::SetPressureResponse* response) {
  constexpr const char* kCall = "SetPressure";
  if (const auto good = CheckRequest(*request); !good) return RefuseCall(*context, kCall, good.error());
  const auto order = ParseOrder(*request);
  if (!order) return RefuseCall(*context, kCall, order.error());
  const auto regulator = FindRegulator(arm_, request->link());
  if (!regulator) return RefuseCall(*context, kCall, regulator.error());
  const auto set = (*regulator)->Set(*order);
  const std::string who = Who(*context, *security_);
  arm_.events().Audit("pressure", ToOperation(*request, set, who));
  if (!set) return RefuseCall(*context, kCall, set.error());
  if (set->ended_a_trip) {
    SPDLOG_INFO("link {}: the pressure regulator was reset by {}", request->link(), who);
    arm_.events().Post(EventKind::kPressureTrip, *arm_.FindLink(request->link()),
                       {.who = who, .accepted = true, .outcome = "reset", .values = {}});
  }
  Fill(set->status, (*regulator)->options(), *response->mutable_regulator());
  auto* reactor = context->DefaultReactor();
  reactor->Finish(grpc::Status::OK);
  return reactor;
}

grpc::ServerUnaryReactor* PressureService::GetPressure(grpc::CallbackServerContext* context,
                                                       const v1::GetPressureRequest* request,
                                                       v1::GetPressureResponse* response) {
  constexpr const char* kCall = "GetPressure";
  if (const auto good = CheckRequest(*request); !good) return RefuseCall(*context, kCall, good.error());
  const auto regulator = FindRegulator(arm_, request->link());
  if (!regulator) return RefuseCall(*context, kCall, regulator.error());
  Fill((*regulator)->Status(), (*regulator)->options(), *response->mutable_regulator());
  auto* reactor = context->DefaultReactor();
  reactor->Finish(grpc::Status::OK);
  return reactor;
}

}  // namespace taclink::server
