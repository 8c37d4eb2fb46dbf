#pragma once

#include "server/arm.h"
#include "server/rpc/update_stream.h"
#include "taclink/v1/joints.pb.h"

namespace taclink::server {

/// Serves one UpdateJointStates call; gRPC owns what is returned.
grpc::ServerReadReactor<v1::UpdateJointStatesRequest>* TakeJointStates(
    Arm& arm, UpdateRegistry& registry, const Party& party, v1::UpdateJointStatesResponse& response);

}  // namespace taclink::server
