#include "server/config/config_http.h"

#include <sstream>

#include "server/config/config.h"
#include "server/config/config_names.h"

namespace taclink::server {
namespace {

constexpr Range kConnections{.min = 1, .max = 10000};
constexpr Range kTimeouts{.min = 0.01, .max = 3600};

}  // namespace

Result<void> CheckHttpListen(const std::string& address) {
  if (address.empty()) return {};
  if (address.starts_with("unix:"))
    return Error{ErrorCode::kInvalidArgument, "must be host:port or [ip6]:port, not a unix socket"};
  return CheckListenAddress(address);
}

HttpConfig ReadHttp(YamlMap& root, const std::function<std::string(const std::string&)>& path) {
  HttpConfig config;
  YamlMap http = root.Map("http");
  if (http.Has("listen")) {
    config.listen = http.Text("listen");
    if (const auto good = CheckHttpListen(*config.listen); !good) http.Fail("listen", good.error().message);
  }
  const std::string web_root = http.Text("web_root", "");
  if (!web_root.empty()) config.web_root = path(web_root);
  config.max_connections = http.Integer("max_connections", config.max_connections, kConnections);
  config.max_connections_per_peer =
      http.Integer("max_connections_per_peer", config.max_connections_per_peer, kConnections);
  config.header_timeout_s = http.Number("header_timeout_s", config.header_timeout_s, kTimeouts);
  config.idle_timeout_s = http.Number("idle_timeout_s", config.idle_timeout_s, kTimeouts);
  config.write_timeout_s = http.Number("write_timeout_s", config.write_timeout_s, kTimeouts);
  http.Done();
  return config;
}

std::string HttpText(const HttpConfig& config) {
  std::ostringstream out;
  out.precision(12);
  out << "http:\n";
  if (config.listen) {
    out << "  listen: " << Quoted(*config.listen) << "\n";
  } else {
    out << "  # listen: " << kDefaultHttpListen << " if it is free\n";
  }
  if (!config.web_root.empty()) out << "  web_root: " << Quoted(config.web_root) << "\n";
  out << "  max_connections: " << config.max_connections << "\n"
      << "  max_connections_per_peer: " << config.max_connections_per_peer << "\n"
      << "  header_timeout_s: " << config.header_timeout_s << "\n"
      << "  idle_timeout_s: " << config.idle_timeout_s << "\n"
      << "  write_timeout_s: " << config.write_timeout_s << "\n";
  return out.str();
}

}  // namespace taclink::server
