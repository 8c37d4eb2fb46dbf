#pragma once

#include <grpcpp/security/server_credentials.h>

#include <memory>
#include <string>

#include "server/security/security.h"

namespace taclink::server {

/// Whether connections at this address are encrypted.
bool HasTls(const std::string& listen, const Security& security);

/// How gRPC listens at an address: TLS with the certificates of the moment, each call checked against the
/// table of who may call what; in the clear where `security` asks for nothing. Unix sockets need no TLS.
std::shared_ptr<grpc::ServerCredentials> MakeCredentials(const std::string& listen,
                                                         const std::shared_ptr<const Security>& security);

}  // namespace taclink::server
