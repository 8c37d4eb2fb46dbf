#pragma once

#include <functional>
#include <string>

#include "sensing/yaml/yaml_reader.h"

namespace taclink::server {

/// Files that guard the server; empty: none. Read anew when they change.
struct SecurityConfig {
  std::string certificate;    ///< PEM, the server's own first: TLS for gRPC and HTTP
  std::string key;            ///< PEM, of the certificate
  std::string client_ca;      ///< PEM: clients must show a certificate signed by one of these
  std::string tokens;         ///< see Tokens; without it everyone who can connect is an operator
  bool tokens_keep = false;   ///< a token file that went bad: the tokens before stay in use, else none do
  bool tokens_open = false;   ///< the token file may be open to all users of the machine
  int max_failed_tries = 20;  ///< with tokens that are not good, a minute from one address; 0: no limit
};

/// The section `security`; `path` makes a path of the file usable as it stands.
SecurityConfig ReadSecurity(YamlMap& root, const std::function<std::string(const std::string&)>& path);
/// Reads back to the same.
std::string SecurityText(const SecurityConfig& config);

}  // namespace taclink::server
