#pragma once

#include <grpcpp/support/byte_buffer.h>

#include <string>
#include <vector>

#include "sensing/core/result.h"
#include "server/rpc/requests/service_limits.h"
#include "server/rpc/streams/frame_stream.h"

namespace taclink::server {

/// What a client asks for with the bytes of a StreamFramesRequest. Errors: kInvalidArgument, kNotFound.
Result<FrameStreamOptions> ParseStreamRequest(const grpc::ByteBuffer& bytes,
                                              const std::vector<std::string>& link_names,
                                              const ServiceLimits& limits);

}  // namespace taclink::server
