#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <string>

#include "client/cpp/taclink/client.h"

namespace taclink::client {

/// A channel whose every call carries the token, if there is one. Errors: kNotFound (a file),
/// kInvalidArgument (a token in the clear to another machine; a certificate without its key or TLS;
/// TACLINK_PATIENCE_S).
Result<std::shared_ptr<grpc::Channel>> MakeChannel(const std::string& address,
                                                   const Credentials& credentials);

}  // namespace taclink::client
