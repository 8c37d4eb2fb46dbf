#pragma once

#include "server/arm.h"
#include "server/rpc/update_stream.h"
#include "taclink/v1/arm.pb.h"
#include "taclink/v1/joints.pb.h"

namespace taclink::server {

/// Serves one UpdateJointStates call; gRPC owns what is returned.
grpc::ServerReadReactor<v1::UpdateJointStatesRequest>* TakeJointStates(
    Arm& arm, UpdateRegistry& registry, v1::UpdateJointStatesResponse& response);

/// The base frame and the joints of the URDF, with their positions now.
void FillJoints(const Arm& arm, v1::Arm& out);

}  // namespace taclink::server
