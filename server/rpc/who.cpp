#include "server/rpc/who.h"

#include "server/forwarded.h"
#include "server/rpc/stream_registry.h"

namespace taclink::server {
namespace {

std::string Metadata(const grpc::ServerContextBase& context, const char* key) {
  const auto at = context.client_metadata().find(key);
  return at == context.client_metadata().end() ? std::string()
                                               : std::string(at->second.data(), at->second.size());
}

bool IsForwarded(const grpc::ServerContextBase& context) {
  return PeerAddress(context.peer()).empty() && context.client_metadata().contains(kForwardedPeer);
}

std::string NameOf(const grpc::ServerContextBase& context, const Security& security) {
  if (IsForwarded(context)) return Metadata(context, kForwardedName);
  std::string name = security.NameOf(Metadata(context, "authorization"));
  if (!name.empty()) return name;
  const auto auth = context.auth_context();
  if (!auth || !auth->IsPeerAuthenticated()) return name;
  for (const auto& identity : auth->GetPeerIdentity()) name.assign(identity.data(), identity.size());
  return name;
}

}  // namespace

std::string PeerOf(const grpc::ServerContextBase& context) {
  return IsForwarded(context) ? Metadata(context, kForwardedPeer) : context.peer();
}

std::string Who(const grpc::ServerContextBase& context, const Security& security) {
  const std::string name = NameOf(context, security);
  return name.empty() ? PeerOf(context) : name + " " + PeerOf(context);
}

}  // namespace taclink::server
