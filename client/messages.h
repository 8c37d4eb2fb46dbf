#pragma once

#include "client/taclink/client.h"
#include "taclink/v1/tactile.pb.h"

namespace taclink::client {

// Messages to the client's types and back; both are in SI units.
Arm FromMessage(const v1::Arm& message);
Frame FromMessage(const v1::LinkFrame& message);
std::vector<StreamCounts> FromMessage(const v1::StreamStatus& message);
CalibrationResult FromMessage(const v1::CalibrationResult& message);
v1::StreamFramesRequest ToMessage(const StreamOptions& options);
v1::CalibrateRequest ToMessage(const CalibrateOptions& options);

}  // namespace taclink::client
