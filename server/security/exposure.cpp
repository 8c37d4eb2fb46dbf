#include "server/security/exposure.h"

namespace taclink::server {
namespace {

Error Refusal(const std::string& address, const std::string& why) {
  return {ErrorCode::kInvalidArgument, "refusing to listen on " + address + " " + why};
}

}  // namespace

Result<std::vector<std::string>> CheckExposure(const Config& config, bool insecure_open) {
  const SecurityConfig& security = config.security;
  std::vector<std::string> addresses = {config.listen};
  if (config.http.listen && !config.http.listen->empty()) addresses.push_back(*config.http.listen);
  std::vector<std::string> warnings;
  for (const std::string& address : addresses) {
    if (IsLoopback(address)) continue;
    const bool encrypted = !security.certificate.empty();
    if (encrypted && !(security.tokens.empty() && security.client_ca.empty())) continue;
    if (!encrypted && !security.tokens.empty())
      return Refusal(address,
                     "with tokens but without encryption: anyone could read the tokens; set "
                     "security.certificate and security.key, or use a loopback address");
    if (!insecure_open)
      return Refusal(address,
                     encrypted ? "for everyone who can reach it; set security.tokens or security.client_ca, "
                                 "or use --insecure-open if the network is trusted"
                               : "without encryption; use a loopback address, set security.certificate "
                                 "and security.tokens, or use --insecure-open if the network is trusted");
    warnings.push_back("LISTENING ON " + address +
                       (encrypted ? " WITHOUT AUTHENTICATION" : " WITHOUT ENCRYPTION OR AUTHENTICATION") +
                       ": anyone who can reach it can use this server");
  }
  return warnings;
}

}  // namespace taclink::server
