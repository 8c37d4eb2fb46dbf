#pragma once

#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/server_callback.h>

#include "sensing/core/result.h"

namespace taclink::server {

/// Ends a call that is refused, and logs it.
grpc::ServerUnaryReactor* RefuseCall(grpc::CallbackServerContext& context, const char* method,
                                     const Error& error);
/// Ends a streaming call before it began, and logs it.
grpc::ServerWriteReactor<grpc::ByteBuffer>* RefuseStream(const grpc::CallbackServerContext& context,
                                                         const char* method, const Error& error);

}  // namespace taclink::server
