#pragma once

#include <sys/socket.h>

#include <string>

namespace taclink::server {

/// The text of an address, much as gRPC gives it: "ipv4:192.168.1.5:40000", "ipv6:[::1]:40000", "unix:".
std::string PeerText(const sockaddr& address);

/// Where a call comes from.
struct Place {
  /// As in what gRPC calls a peer, without the port: "ipv4:192.168.1.5". Of IPv6 the /64 network, which is
  /// what one subscriber gets. Empty: from within this process.
  std::string address;
  bool local = false;  ///< this machine
};
/// `peer` as gRPC tells it: "ipv4:192.168.1.5:40000", "ipv6:%5B::1%5D:40000", "unix:/run/taclink".
Place PlaceOf(const std::string& peer);

/// Those who share what one caller may have.
struct Party {
  std::string who;         ///< empty: this process, or a unix socket's programs; these count only among all
  bool preferred = false;  ///< what is kept is for these
};
/// A caller that is known by `name` counts by it, wherever it calls from. One without a name (empty) counts
/// by its address; on this machine, where all programs have the same, by its connection. Preferred are those
/// with a name and those on this machine.
Party PartyOf(const std::string& peer, const std::string& name);

}  // namespace taclink::server
