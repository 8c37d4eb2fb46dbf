#pragma once

#include <grpcpp/server_context.h>

#include <string>

#include "server/security/party.h"
#include "server/security/security.h"

namespace taclink::server {

/// Where a call comes from, as gRPC tells a peer ("ipv4:192.168.1.5:41234"); of a call through the HTTP
/// gateway its client's.
std::string PeerOf(const grpc::ServerContextBase& context);

/// Who the server takes a caller for.
Caller CallerOf(const grpc::ServerContextBase& context, const Security& security);

/// Whose share of streams and calls this one takes.
Party PartyOf(const grpc::ServerContextBase& context, const Security& security);

/// Who calls, for logs and the audit: the name of the token or of the certificate, if there is any, with the
/// peer.
std::string Who(const grpc::ServerContextBase& context, const Security& security);

}  // namespace taclink::server
