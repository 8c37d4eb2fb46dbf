#pragma once

#include "server/arm/arm.h"
#include "server/rpc/streams/update_stream.h"

namespace taclink::server {

/// Serves one UpdatePressure call; gRPC owns what is returned.
grpc::ServerReadReactor<grpc::ByteBuffer>* TakePressure(Arm& arm, UpdateRegistry& registry,
                                                        const Party& party, grpc::ByteBuffer& response);
/// Likewise, of UpdateAttitude.
grpc::ServerReadReactor<grpc::ByteBuffer>* TakeAttitude(Arm& arm, UpdateRegistry& registry,
                                                        const Party& party, grpc::ByteBuffer& response);

}  // namespace taclink::server
