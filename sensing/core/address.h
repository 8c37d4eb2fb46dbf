#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sensing/core/result.h"

namespace taclink {

struct HostPort {
  std::string host;  ///< an IPv6 address without its brackets
  int port = 0;      ///< 0 to 65535
};
/// The one parser of addresses: HOST:PORT, of which HOST is a name, an IPv4 address, or an IPv6 address in
/// brackets; without ":PORT" the `default_port`, if there is one. Looks up no names. Errors: kInvalidArgument
/// with the part that is wrong.
Result<HostPort> ParseHostPort(std::string_view address, std::optional<int> default_port = {});

/// Where a server listens: host:port, [ip6]:port or unix:path. Errors: kInvalidArgument, to be put behind
/// what the address is of.
Result<void> CheckListenAddress(const std::string& address);
/// Likewise without unix:path; empty: nowhere.
Result<void> CheckHttpListen(const std::string& address);
/// Whether only this machine can connect there.
bool IsLoopback(const std::string& address);

/// URLs with commas between, in their parts.
std::vector<std::string> SplitUrls(const std::string& urls);
/// Of NATS servers: nats://HOST:PORT or tls://HOST:PORT, without ":PORT" 4222, without passwords; or empty.
/// Errors: as CheckListenAddress.
Result<void> CheckNatsUrls(const std::string& urls);

}  // namespace taclink
