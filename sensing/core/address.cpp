#include "sensing/core/address.h"

#include <arpa/inet.h>

#include <algorithm>
#include <charconv>
#include <optional>

namespace taclink {
namespace {

constexpr std::string_view kUnixScheme = "unix:";

struct HostPort {
  std::string host;
  int port = 0;
};

std::optional<HostPort> Split(const std::string& address) {
  const auto colon = address.rfind(':');
  if (colon == std::string::npos) return {};
  HostPort out{.host = address.substr(0, colon)};
  const char* const first = address.data() + colon + 1;
  const char* const last = address.data() + address.size();
  const auto [end, error] = std::from_chars(first, last, out.port);
  if (error != std::errc() || end != last || out.port < 0 || out.port > 65535) return {};
  if (out.host.starts_with('[') && out.host.ends_with(']')) {
    out.host = out.host.substr(1, out.host.size() - 2);
  } else if (out.host.find(':') != std::string::npos) {
    return {};  // an IPv6 address without brackets would be read as something else
  }
  if (out.host.empty()) return {};
  return out;
}

}  // namespace

Result<void> CheckListenAddress(const std::string& address) {
  if (address.starts_with(kUnixScheme) && address.size() > kUnixScheme.size()) return {};
  if (Split(address)) return {};
  return Error{
      ErrorCode::kInvalidArgument,
      "must be host:port, [ip6]:port or unix:path, for example 127.0.0.1:50051, not '" + address + "'"};
}

Result<void> CheckHttpListen(const std::string& address) {
  if (address.empty()) return {};
  if (address.starts_with(kUnixScheme))
    return Error{ErrorCode::kInvalidArgument, "must be host:port or [ip6]:port, not a unix socket"};
  return CheckListenAddress(address);
}

bool IsLoopback(const std::string& address) {
  if (address.starts_with(kUnixScheme)) return true;
  const auto split = Split(address);
  if (!split) return false;
  in_addr v4{};
  if (inet_pton(AF_INET, split->host.c_str(), &v4) == 1) return (ntohl(v4.s_addr) >> 24) == 127;
  in6_addr v6{};
  if (inet_pton(AF_INET6, split->host.c_str(), &v6) == 1) return IN6_IS_ADDR_LOOPBACK(&v6);
  return split->host == "localhost";
}

std::vector<std::string> SplitUrls(const std::string& urls) {
  std::vector<std::string> out;
  for (size_t begin = 0; begin <= urls.size();) {
    const size_t end = std::min(urls.find(',', begin), urls.size());
    out.push_back(urls.substr(begin, end - begin));
    begin = end + 1;
  }
  return out;
}

Result<void> CheckNatsUrls(const std::string& urls) {
  if (urls.empty()) return {};
  for (const std::string& url : SplitUrls(urls)) {
    if (!url.starts_with("nats://") && !url.starts_with("tls://"))
      return Error{ErrorCode::kInvalidArgument,
                   "must be nats://HOST:PORT or tls://HOST:PORT, several with commas between"};
    if (url.find('@') != std::string::npos)
      return Error{ErrorCode::kInvalidArgument, "must not hold a password; use token_file or credentials"};
  }
  return {};
}

}  // namespace taclink
