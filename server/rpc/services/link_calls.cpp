#include "server/rpc/services/link_calls.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/replay/replay_link.h"
#include "wire/convert.h"

namespace taclink::server {
namespace {

constexpr double kExposureUnitsPerS = 1e4;

Error InvalidOrder(std::string message) {
  return {ErrorCode::kInvalidArgument, std::move(message)};
}

Operation Ended(const Result<void>& end, std::string who, std::string done) {
  return {.who = std::move(who),
          .accepted = end.ok(),
          .outcome = end ? std::move(done) : end.error().message,
          .values = {}};
}

}  // namespace

Result<CameraOrder> ParseCameraRequest(const v1::SetCameraRequest& request) {
  CameraOrder order;
  for (const CameraId id : kBothCameras)
    order.cameras[Index(id)] = request.camera().empty() || request.camera() == Name(id);
  if (!order.cameras[0] && !order.cameras[1])
    return InvalidOrder("camera must be top, bottom or empty for both");
  switch (request.exposure_case()) {
    case v1::SetCameraRequest::kAutomatic:
      if (!request.automatic())
        return InvalidOrder("automatic must be true; for a fixed exposure give exposure_s");
      order.settings.automatic_exposure = true;
      break;
    case v1::SetCameraRequest::kExposureS:
      order.settings.exposure_100us =
          std::max(1, static_cast<int>(std::lround(request.exposure_s() * kExposureUnitsPerS)));
      break;
    case v1::SetCameraRequest::EXPOSURE_NOT_SET:
      if (!request.has_gain()) return InvalidOrder("neither an exposure nor a gain is given");
      break;
  }
  if (request.has_gain()) order.settings.gain = request.gain();
  return order;
}

Operation ToOperation(const v1::SetCameraRequest& request, const Result<void>& end, std::string who) {
  const std::string camera = request.camera().empty() ? "both cameras" : request.camera() + " camera";
  Operation out = Ended(end, std::move(who), camera + (request.automatic() ? ", automatic exposure" : ""));
  if (request.has_exposure_s()) out.values["exposure_s"] = request.exposure_s();
  if (request.has_gain()) out.values["gain"] = request.gain();
  return out;
}

Result<std::optional<ForceModel>> ParseForceModel(const v1::SetForceModelRequest& request) {
  if (request.model() == v1::FORCE_MODEL_UNSPECIFIED)
    return InvalidOrder("model must be AUTO, LINEAR, LITERAL, PRESSURISED or NONLINEAR");
  if (request.model() == v1::FORCE_MODEL_AUTO) return std::optional<ForceModel>();
  return std::optional(wire::FromWire(request.model()));
}

Operation ToOperation(std::optional<ForceModel> model, const Result<void>& end, std::string who) {
  return Ended(end, std::move(who), v1::ForceModel_Name(model ? wire::ToWire(*model) : v1::FORCE_MODEL_AUTO));
}

Result<size_t> FindLiveLink(const Arm& arm, const std::string& name) {
  auto link = arm.FindLink(name);
  if (link && arm.plays_log()) return PlaysLog();
  return link;
}

}  // namespace taclink::server
