#pragma once

#include <functional>
#include <optional>
#include <string>

#include "sensing/yaml/yaml_reader.h"

namespace taclink::server {

inline constexpr const char* kDefaultHttpListen = "127.0.0.1:8080";

/// The HTTP gateway: web page, gRPC-Web, metrics, health.
struct HttpConfig {
  /// host:port or [ip6]:port; port 0: any free one; empty: off; none: kDefaultHttpListen if it is free.
  std::optional<std::string> listen;
  std::string web_root;               ///< folder of the web page; empty: the one built in
  int max_connections = 128;          ///< at a time; a quarter is kept for this machine
  int max_connections_per_peer = 32;  ///< of one address
  double header_timeout_s =
      10;  ///< from the first byte of a request to its last, and for the first byte of all
  double idle_timeout_s = 60;    ///< between two requests
  double write_timeout_s = 120;  ///< a client that takes nothing for this long has gone
};

/// The section `http`; `path` makes a path of the file usable as it stands.
HttpConfig ReadHttp(YamlMap& root, const std::function<std::string(const std::string&)>& path);
/// Reads back to the same.
std::string HttpText(const HttpConfig& config);
/// As the configuration and --http-listen take it. Errors: kInvalidArgument.
Result<void> CheckHttpListen(const std::string& address);

}  // namespace taclink::server
