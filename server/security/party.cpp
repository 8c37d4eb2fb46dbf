#include "server/security/party.h"

#include <arpa/inet.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>
#include <string_view>

namespace taclink::server {
namespace {

constexpr std::string_view kIpv4 = "ipv4:", kIpv6 = "ipv6:", kUnix = "unix";

// What stands in brackets, which gRPC writes as %5B and %5D, without the scope.
std::string WithoutBrackets(std::string_view host) {
  for (const std::string_view bracket : {"[", "%5B", "%5b"})
    if (host.starts_with(bracket)) host.remove_prefix(bracket.size());
  return std::string(host.substr(0, host.find_first_of("]%")));
}

std::string_view WithoutPort(std::string_view peer, size_t begin) {
  const std::string_view host = peer.substr(begin);
  return host.substr(0, host.rfind(':'));
}

Place Ipv4Place(std::string_view host) {
  return {.address = std::string(kIpv4).append(host), .local = host.starts_with("127.")};
}

Place Ipv6Place(std::string_view host) {
  in6_addr address{};
  if (::inet_pton(AF_INET6, WithoutBrackets(host).c_str(), &address) != 1)
    return {.address = std::string(kIpv6).append(host)};
  std::array<char, INET6_ADDRSTRLEN> text{};
  if (IN6_IS_ADDR_V4MAPPED(&address)) {
    ::inet_ntop(AF_INET, &address.s6_addr[12], text.data(), text.size());
    return Ipv4Place(text.data());
  }
  // Neighbors on one wire share the network of link-local addresses.
  const bool whole = IN6_IS_ADDR_LOOPBACK(&address) || IN6_IS_ADDR_LINKLOCAL(&address);
  if (!whole) std::fill(std::begin(address.s6_addr) + 8, std::end(address.s6_addr), uint8_t{0});
  ::inet_ntop(AF_INET6, &address, text.data(), text.size());
  return {.address = std::string(kIpv6).append(text.data()).append(whole ? "" : "/64"),
          .local = IN6_IS_ADDR_LOOPBACK(&address) != 0};
}

std::string Text(std::string_view scheme, const std::string& host, in_port_t port) {
  return std::string(scheme) + host + ":" + std::to_string(ntohs(port));
}

}  // namespace

std::string PeerText(const sockaddr& address) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  switch (address.sa_family) {
    case AF_INET: {
      const auto& from = reinterpret_cast<const sockaddr_in&>(address);
      ::inet_ntop(AF_INET, &from.sin_addr, text.data(), text.size());
      return Text(kIpv4, text.data(), from.sin_port);
    }
    case AF_INET6: {
      const auto& from = reinterpret_cast<const sockaddr_in6&>(address);
      if (IN6_IS_ADDR_V4MAPPED(&from.sin6_addr)) {
        ::inet_ntop(AF_INET, &from.sin6_addr.s6_addr[12], text.data(), text.size());
        return Text(kIpv4, text.data(), from.sin6_port);
      }
      ::inet_ntop(AF_INET6, &from.sin6_addr, text.data(), text.size());
      return Text(kIpv6, "[" + std::string(text.data()) + "]", from.sin6_port);
    }
    default:
      return "unix:";
  }
}

Place PlaceOf(const std::string& peer) {
  if (peer.starts_with("unix:")) return {.address = std::string(kUnix), .local = true};
  if (peer.starts_with(kIpv4)) return Ipv4Place(WithoutPort(peer, kIpv4.size()));
  if (peer.starts_with(kIpv6)) return Ipv6Place(WithoutPort(peer, kIpv6.size()));
  return {.address = {}, .local = true};
}

Party PartyOf(const std::string& peer, const std::string& name) {
  if (!name.empty()) return {.who = "caller " + name, .preferred = true};
  const Place place = PlaceOf(peer);
  // gRPC gives all connections of a unix socket the same peer; the permissions of its file say who may
  // connect.
  if (place.address.empty() || place.address == kUnix) return {.who = {}, .preferred = true};
  if (place.local) return {.who = "the connection " + peer, .preferred = true};
  return {.who = "clients at " + place.address};
}

}  // namespace taclink::server
