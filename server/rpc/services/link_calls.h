#pragma once

#include <optional>
#include <string>

#include "sensing/core/result.h"
#include "server/arm/arm.h"
#include "server/events/event.h"
#include "server/link/camera_memory.h"
#include "taclink/v1/tactile.pb.h"

namespace taclink::server {

/// What a SetCamera call asks for. Errors: kInvalidArgument.
Result<CameraOrder> ParseCameraRequest(const v1::SetCameraRequest& request);
/// For the audit.
Operation ToOperation(const v1::SetCameraRequest& request, const Result<void>& end, std::string who);

/// What a SetForceModel call asks for; none: by tolerance, frame by frame.
/// Errors: kInvalidArgument.
Result<std::optional<ForceModel>> ParseForceModel(const v1::SetForceModelRequest& request);
Operation ToOperation(std::optional<ForceModel> model, const Result<void>& end, std::string who);

/// The index of a link to which something is to be done. Errors: kNotFound, kFailedPrecondition (a log is
/// played).
Result<size_t> FindLiveLink(const Arm& arm, const std::string& name);

}  // namespace taclink::server
