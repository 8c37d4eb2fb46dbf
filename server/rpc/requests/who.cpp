#include "server/rpc/requests/who.h"

#include "server/security/forwarded.h"

namespace taclink::server {
namespace {

std::string Metadata(const grpc::ServerContextBase& context, const char* key) {
  const auto at = context.client_metadata().find(key);
  return at == context.client_metadata().end() ? std::string()
                                               : std::string(at->second.data(), at->second.size());
}

bool IsForwarded(const grpc::ServerContextBase& context) {
  return PlaceOf(context.peer()).address.empty() && context.client_metadata().contains(kForwardedPeer);
}

}  // namespace

std::string PeerOf(const grpc::ServerContextBase& context) {
  return IsForwarded(context) ? Metadata(context, kForwardedPeer) : context.peer();
}

Caller CallerOf(const grpc::ServerContextBase& context, const Security& security) {
  if (IsForwarded(context)) {
    const std::string role = Metadata(context, kForwardedRole);
    return {Metadata(context, kForwardedName),
            role.empty() ? Role::kNobody : static_cast<Role>(role.front())};
  }
  Caller caller = security.Identify(Metadata(context, "authorization"));
  if (!caller.name.empty()) return caller;
  const auto auth = context.auth_context();
  if (!auth || !auth->IsPeerAuthenticated()) return caller;
  for (const auto& identity : auth->GetPeerIdentity()) caller.name.assign(identity.data(), identity.size());
  return caller;
}

Party PartyOf(const grpc::ServerContextBase& context, const Security& security) {
  return PartyOf(PeerOf(context), CallerOf(context, security).name);
}

std::string Who(const grpc::ServerContextBase& context, const Security& security) {
  const std::string name = CallerOf(context, security).name;
  return name.empty() ? PeerOf(context) : name + " " + PeerOf(context);
}

}  // namespace taclink::server
