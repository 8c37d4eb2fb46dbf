#include "server/config/config_security.h"

#include <array>
#include <utility>

#include "server/config/config_names.h"

namespace taclink::server {
namespace {

constexpr std::array<std::pair<const char*, std::string SecurityConfig::*>, 4> kFiles = {
    {{"certificate", &SecurityConfig::certificate},
     {"key", &SecurityConfig::key},
     {"client_ca", &SecurityConfig::client_ca},
     {"tokens", &SecurityConfig::tokens}}};

constexpr const char* kOnError = "tokens_on_error";
constexpr std::array<std::string_view, 2> kOnErrorWords = {"refuse", "keep"};
constexpr const char* kPermissions = "tokens_permissions";
constexpr std::array<std::string_view, 2> kPermissionWords = {"strict", "any"};
constexpr const char* kFailedTries = "max_failed_tries_per_minute";

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
  config.tokens_keep = security.Choice(kOnError, {kOnErrorWords.begin(), kOnErrorWords.end()}, 0) == 1;
  config.tokens_open =
      security.Choice(kPermissions, {kPermissionWords.begin(), kPermissionWords.end()}, 0) == 1;
  config.max_failed_tries =
      security.Integer(kFailedTries, config.max_failed_tries, {.min = 0, .max = 1'000'000});
  security.Done();
  return config;
}

std::string SecurityText(const SecurityConfig& config) {
  std::string out;
  for (const auto& [name, member] : kFiles) {
    if (!(config.*member).empty()) out += std::string("  ") + name + ": " + Quoted(config.*member) + "\n";
  }
  const std::string indent = "  ";
  out += indent + kOnError + ": " + std::string(kOnErrorWords[config.tokens_keep ? 1 : 0]) + "\n";
  out += indent + kPermissions + ": " + std::string(kPermissionWords[config.tokens_open ? 1 : 0]) + "\n";
  out += indent + kFailedTries + ": " + std::to_string(config.max_failed_tries) + "\n";
  return "security:\n" + out;
}

}  // namespace taclink::server
