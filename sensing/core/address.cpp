#include "sensing/core/address.h"

#include <arpa/inet.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

namespace taclink {
namespace {

constexpr std::string_view kUnixScheme = "unix:";

Error Wrong(std::string message) {
  return {ErrorCode::kInvalidArgument, std::move(message)};
}

bool IsDigit(char c) {
  return c >= '0' && c <= '9';
}

bool IsIpv4(const std::string& host) {
  in_addr ignored{};
  return inet_pton(AF_INET, host.c_str(), &ignored) == 1;
}

// With the scope of a link-local address: fe80::1%eth0.
bool IsIpv6(const std::string& host) {
  in6_addr ignored{};
  const auto scope = host.find('%');
  return scope + 1 != host.size() && inet_pton(AF_INET6, host.substr(0, scope).c_str(), &ignored) == 1;
}

bool IsHostName(std::string_view host) {
  constexpr size_t kLongestHost = 253, kLongestPart = 63;  // RFC 1035
  if (host.ends_with('.')) host.remove_suffix(1);
  if (host.empty() || host.size() > kLongestHost) return false;
  for (size_t begin = 0; begin <= host.size();) {
    const size_t end = std::min(host.find('.', begin), host.size());
    const std::string_view part = host.substr(begin, end - begin);
    const bool good = std::ranges::all_of(part, [](char c) {
      return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || IsDigit(c) || c == '-' || c == '_';
    });
    if (!good || part.empty() || part.size() > kLongestPart || part.front() == '-') return false;
    begin = end + 1;
  }
  return true;
}

// Empty: nothing is.
std::string WhatIsWrongWithHost(const std::string& host, bool in_brackets) {
  if (in_brackets) return IsIpv6(host) ? "" : "what is in brackets must be an IPv6 address";
  if (host.empty()) return "the host is missing";
  if (host.find(':') != std::string::npos) return "an IPv6 address must be in brackets";
  const bool numbers = std::ranges::all_of(host, [](char c) { return IsDigit(c) || c == '.'; });
  if (numbers) return IsIpv4(host) ? "" : "an IPv4 address must be four numbers from 0 to 255";
  return IsHostName(host) ? "" : "a host's name may only have letters, digits, '-', '_' and '.'";
}

std::optional<int> ParsePort(std::string_view digits) {
  constexpr int kLastPort = 65535;
  int port = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
  if (error != std::errc() || end != digits.data() + digits.size() || port < 0 || port > kLastPort) return {};
  return port;
}

// What gRPC takes for a scheme where it stands before a colon.
bool IsGrpcScheme(std::string_view host) {
  constexpr std::array<std::string_view, 5> kSchemes = {"dns", "ipv4", "ipv6", "unix-abstract", "vsock"};
  return std::ranges::find(kSchemes, host) != kSchemes.end();
}

}  // namespace

Result<HostPort> ParseHostPort(std::string_view address, std::optional<int> default_port) {
  const bool in_brackets = address.starts_with('[');
  const size_t host_end = in_brackets ? address.find(']') : address.rfind(':');
  if (in_brackets && host_end == std::string_view::npos) return Wrong("'[' has no ']'");
  HostPort out{.host = std::string(address.substr(0, host_end)), .port = default_port.value_or(0)};
  std::string_view rest = host_end == std::string_view::npos ? "" : address.substr(host_end);
  if (in_brackets) {
    out.host.erase(0, 1);
    rest.remove_prefix(1);
  }
  if (const std::string wrong = WhatIsWrongWithHost(out.host, in_brackets); !wrong.empty())
    return Wrong(wrong);
  if (rest.empty() && default_port) return out;
  if (rest.empty()) return Wrong("the port is missing");
  const auto port = rest.front() == ':' ? ParsePort(rest.substr(1)) : std::nullopt;
  if (!port) return Wrong("the port must be ':' and a number from 0 to 65535");
  out.port = *port;
  return out;
}

Result<void> CheckListenAddress(const std::string& address) {
  if (address.starts_with(kUnixScheme) && address.size() > kUnixScheme.size()) return {};
  const auto parsed = ParseHostPort(address);
  if (parsed && !IsGrpcScheme(parsed->host)) return {};
  return Wrong(
      "must be host:port, [ip6]:port or unix:path, for example 127.0.0.1:50051, not '" + address + "': " +
      (parsed ? "'" + parsed->host + "' is a scheme of gRPC; give the IP address" : parsed.error().message));
}

Result<void> CheckHttpListen(const std::string& address) {
  if (address.empty()) return {};
  if (address.starts_with(kUnixScheme)) return Wrong("must be host:port or [ip6]:port, not a unix socket");
  return CheckListenAddress(address);
}

bool IsLoopback(const std::string& address) {
  if (address.starts_with(kUnixScheme)) return true;
  const auto parsed = ParseHostPort(address);
  if (!parsed) return false;
  in_addr v4{};
  if (inet_pton(AF_INET, parsed->host.c_str(), &v4) == 1) return (ntohl(v4.s_addr) >> 24) == 127;
  in6_addr v6{};
  if (inet_pton(AF_INET6, parsed->host.c_str(), &v6) == 1) return IN6_IS_ADDR_LOOPBACK(&v6);
  return parsed->host == "localhost";
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
  constexpr int kNatsPort = 4222;
  if (urls.empty()) return {};
  if (urls.find('@') != std::string::npos)  // before anything is repeated in a message
    return Wrong("must not hold a password; use token_file or credentials");
  for (const std::string& url : SplitUrls(urls)) {
    const auto wrong = [&url](const std::string& why) {
      return Wrong("must be nats://HOST:PORT or tls://HOST:PORT, several with commas between, not '" + url +
                   "': " + why);
    };
    std::string_view rest = url;
    for (const std::string_view scheme : {"nats://", "tls://"})
      if (rest.size() == url.size() && rest.starts_with(scheme)) rest.remove_prefix(scheme.size());
    if (rest.size() == url.size()) return wrong("it begins with neither nats:// nor tls://");
    if (rest.ends_with('/')) rest.remove_suffix(1);
    const auto parsed = ParseHostPort(rest, kNatsPort);
    if (!parsed) return wrong(parsed.error().message);
    if (parsed->port == 0) return wrong("nobody listens on port 0");
  }
  return {};
}

}  // namespace taclink
