#include "server/rpc/services/simulation_service.h"

#include <optional>

#include "server/rpc/requests/refusal.h"
#include "server/rpc/requests/request_check.h"

namespace taclink::server {
namespace {

constexpr double kMmPerMeter = 1e3, kPascalsPerMpa = 1e6;
constexpr double kUsualDiameterMm = 11;

BodyShape ShapeOf(v1::BodyShape shape) {
  switch (shape) {
    case v1::BODY_SHAPE_SPHERE:
      return BodyShape::kSphere;
    case v1::BODY_SHAPE_DISC:
      return BodyShape::kDisc;
    case v1::BODY_SHAPE_PLATE:
      return BodyShape::kPlate;
    case v1::BODY_SHAPE_HAND:
      return BodyShape::kHand;
    default:
      return BodyShape::kFinger;
  }
}

PressedBody BodyOf(const v1::PressRequest& request) {
  PressedBody body{
      .id = request.body_id() == 0 ? 1 : request.body_id(),
      .shape = ShapeOf(request.shape()),
      .diameter_mm = request.diameter_m() == 0 ? kUsualDiameterMm : kMmPerMeter * request.diameter_m(),
      .at = {.angle_rad = request.angle_rad(), .z_mm = kMmPerMeter * request.z_m()},
      .depth_mm = std::nullopt,
      .force_n = std::nullopt};
  if (request.has_depth_m()) body.depth_mm = kMmPerMeter * request.depth_m();
  if (request.has_force_n()) body.force_n = request.force_n();
  return body;
}

}  // namespace

template <typename Request, typename Change>
grpc::ServerUnaryReactor* SimulationService::Do(grpc::CallbackServerContext* context, const char* call,
                                                const Request& request, Change change) {
  if (const auto good = CheckRequest(request); !good) return RefuseCall(*context, call, good.error());
  const auto link = arm_.FindLink(request.link());
  if (!link) return RefuseCall(*context, call, link.error());
  const auto desk = arm_.simulation(*link);
  if (!desk) return RefuseCall(*context, call, desk.error());
  if (const Result<void> done = change(**desk); !done) return RefuseCall(*context, call, done.error());
  auto* reactor = context->DefaultReactor();
  reactor->Finish(grpc::Status::OK);
  return reactor;
}

grpc::ServerUnaryReactor* SimulationService::Press(grpc::CallbackServerContext* context,
                                                   const v1::PressRequest* request, v1::PressResponse*) {
  return Do(context, "Press", *request,
            [&](SimulationDesk& desk) { return desk.Press(BodyOf(*request), request->hold_s()); });
}

grpc::ServerUnaryReactor* SimulationService::Release(grpc::CallbackServerContext* context,
                                                     const v1::ReleaseRequest* request,
                                                     v1::ReleaseResponse*) {
  return Do(context, "Release", *request,
            [&](SimulationDesk& desk) { return desk.Release(request->body_id()); });
}

grpc::ServerUnaryReactor* SimulationService::SetScenePressure(grpc::CallbackServerContext* context,
                                                              const v1::SetScenePressureRequest* request,
                                                              v1::SetScenePressureResponse*) {
  std::optional<double> mpa;
  if (request->has_pressure_pa()) mpa = request->pressure_pa() / kPascalsPerMpa;
  return Do(context, "SetScenePressure", *request,
            [&](SimulationDesk& desk) { return desk.SetPressure(mpa); });
}

grpc::ServerUnaryReactor* SimulationService::MoveSceneJoint(grpc::CallbackServerContext* context,
                                                            const v1::MoveSceneJointRequest* request,
                                                            v1::MoveSceneJointResponse*) {
  std::optional<double> rad;
  if (request->has_position_rad()) rad = request->position_rad();
  return Do(context, "MoveSceneJoint", *request, [&](SimulationDesk& desk) { return desk.MoveJoint(rad); });
}

}  // namespace taclink::server
