#pragma once

namespace taclink::server {

/// Metadata that the HTTP gateway adds to the gRPC calls that it passes on: the address that they come from,
/// as gRPC tells a peer ("ipv4:192.168.1.5:41234"), the caller's name and role (one byte). Believed only from
/// within this process.
inline constexpr const char* kForwardedPeer = "taclink-peer-bin";
inline constexpr const char* kForwardedName = "taclink-name-bin";
inline constexpr const char* kForwardedRole = "taclink-role-bin";

}  // namespace taclink::server
