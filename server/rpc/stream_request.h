#pragma once

#include <google/protobuf/repeated_field.h>
#include <grpcpp/support/byte_buffer.h>

#include <string>
#include <vector>

#include "sensing/core/result.h"
#include "server/link_names.h"
#include "server/rpc/frame_stream.h"
#include "server/rpc/service_limits.h"

namespace taclink::server {

/// Which of `link_names` are among `names`; none of them: empty, for all. Errors as FindLink.
Result<std::vector<bool>> FindLinks(const std::vector<std::string>& link_names,
                                    const google::protobuf::RepeatedPtrField<std::string>& names);

/// What a client asks for with the bytes of a StreamFramesRequest. Errors: kInvalidArgument, kNotFound.
Result<FrameStreamOptions> ParseStreamRequest(const grpc::ByteBuffer& bytes,
                                              const std::vector<std::string>& link_names,
                                              const ServiceLimits& limits);

}  // namespace taclink::server
