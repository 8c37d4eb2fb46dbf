#pragma once

#include "server/arm/arm.h"
#include "server/rpc/streams/update_stream.h"

namespace taclink::server {

/// Serves one UpdateJointStates call; gRPC owns what is returned.
grpc::ServerReadReactor<grpc::ByteBuffer>* TakeJointStates(Arm& arm, UpdateRegistry& registry,
                                                           const Party& party, grpc::ByteBuffer& response);

}  // namespace taclink::server
