#pragma once

#include "client/cpp/taclink/arm_contacts.h"
#include "client/cpp/taclink/client.h"
#include "taclink/v1/tactile.pb.h"

namespace taclink::client {

// Messages to the client's types and back; both are in SI units.
Arm FromMessage(const v1::Arm& message);
Frame FromMessage(const v1::LinkFrame& message);
std::vector<StreamCounts> FromMessage(const v1::StreamStatus& message);
CalibrationResult FromMessage(const v1::CalibrationResult& message);
Vector3 FromMessage(const v1::Vector3& message);
Pose FromMessage(const v1::Pose& message);
LinkStatus FromMessage(v1::LinkStatus status);
ArmContacts FromMessage(const v1::StreamContactsResponse& message);
std::optional<Covariance3> FromMessage(const google::protobuf::RepeatedField<double>& covariance);
v1::StreamFramesRequest ToMessage(const StreamOptions& options);
v1::CalibrateRequest ToMessage(const CalibrateOptions& options);
v1::ForceModel ToMessage(ForceModel model);
Baseline FromMessage(const v1::Baseline& message);
ForceLevelState FromMessage(const v1::ForceLevelState& message);
Event FromMessage(const v1::Event& message);
LinkTare FromMessage(const v1::LinkTare& message);
v1::Thresholds ToMessage(const Thresholds& thresholds);
v1::TareRequest ToMessage(const TareRequest& request);
v1::StreamEventsRequest ToMessage(const EventOptions& options);

}  // namespace taclink::client
