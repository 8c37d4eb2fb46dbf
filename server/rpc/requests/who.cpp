#include "server/rpc/requests/who.h"

#include <grpc/grpc_security_constants.h>

#include "server/security/forwarded.h"
#include "server/security/single_header.h"

namespace taclink::server {
namespace {

std::string_view TextOf(const grpc::string_ref& text) {
  return {text.data(), text.size()};
}

// Empty also where the call has several: these are nobody's.
std::string Metadata(const grpc::ServerContextBase& context, const char* key) {
  SingleHeader header(key);
  for (const auto& [name, value] : context.client_metadata()) header.Read(TextOf(name), TextOf(value));
  const auto value = header.Value();
  return value ? std::string(*value) : std::string();
}

// A certificate can have several names. The first common name counts, as for the HTTP gateway; the first
// alternative name where it has no common name.
std::string CertificateName(const grpc::AuthContext& auth) {
  const auto common_names = auth.FindPropertyValues(GRPC_X509_CN_PROPERTY_NAME);
  if (!common_names.empty() && !common_names.front().empty())
    return std::string(TextOf(common_names.front()));
  const auto names = auth.GetPeerIdentity();
  return names.empty() ? std::string() : std::string(TextOf(names.front()));
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
  caller.name = CertificateName(*auth);
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
