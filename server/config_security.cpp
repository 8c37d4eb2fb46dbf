#include "server/config_security.h"

#include <array>
#include <utility>

#include "server/config_names.h"

namespace taclink::server {
namespace {

constexpr std::array<std::pair<const char*, std::string SecurityConfig::*>, 4> kFiles = {
    {{"certificate", &SecurityConfig::certificate},
     {"key", &SecurityConfig::key},
     {"client_ca", &SecurityConfig::client_ca},
     {"tokens", &SecurityConfig::tokens}}};

}  // namespace

SecurityConfig ReadSecurity(YamlMap& root, const std::function<std::string(const std::string&)>& path) {
  SecurityConfig config;
  YamlMap security = root.Map("security");
  for (const auto& [name, member] : kFiles) {
    const std::string file = security.Text(name, "");
    if (!file.empty()) config.*member = path(file);
  }
  if (config.certificate.empty() != config.key.empty())
    security.Fail(config.key.empty() ? "certificate" : "key",
                  "is of no use alone: 'certificate' and 'key' need each other");
  if (!config.client_ca.empty() && config.certificate.empty())
    security.Fail("client_ca", "needs 'certificate' and 'key': it is asked for within TLS");
  security.Done();
  return config;
}

std::string SecurityText(const SecurityConfig& config) {
  std::string out;
  for (const auto& [name, member] : kFiles) {
    if (!(config.*member).empty()) out += std::string("  ") + name + ": " + Quoted(config.*member) + "\n";
  }
  return out.empty() ? out : "security:\n" + out;
}

}  // namespace taclink::server
