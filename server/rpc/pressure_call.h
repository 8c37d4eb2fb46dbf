#pragma once

#include "server/arm.h"
#include "server/rpc/update_stream.h"
#include "taclink/v1/pressure.pb.h"

namespace taclink::server {

/// Serves one UpdatePressure call; gRPC owns what is returned.
grpc::ServerReadReactor<v1::UpdatePressureRequest>* TakePressure(Arm& arm, UpdateRegistry& registry,
                                                                 const Party& party,
                                                                 v1::UpdatePressureResponse& response);

}  // namespace taclink::server
