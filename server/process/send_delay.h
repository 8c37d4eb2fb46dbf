#pragma once

#include <chrono>

namespace taclink::server {

/// How long a message that soon grows old should wait before it is given to this TCP socket; 0: not at all.
///
/// What the kernel holds (not yet sent, or sent and not acknowledged) goes before it. On a slow link that
/// alone makes it seconds old, and fills the buffers of the routers, which delays other connections, too. So
/// the kernel holds no more than the link delivers in its shortest round trip and kMostQueued: the rate of
/// delivery and the round trip are the kernel's own estimates (TCP_INFO), as in the congestion control BBR
/// (Cardwell et al., 2016). On a fast link the result is 0.
std::chrono::milliseconds SendDelay(int socket);

/// Time for which messages may be queued beyond the round trip.
inline constexpr std::chrono::milliseconds kMostQueued{50};

/// What the kernel knows of a connection.
struct SendState {
  double queued_bytes = 0;
  double bytes_per_s = 0;  ///< that were acknowledged of late; 0: not known yet
  std::chrono::microseconds shortest_round_trip{0}, round_trip{0};
  std::chrono::milliseconds since_acknowledgement{0};
};
/// The estimate alone.
std::chrono::milliseconds SendDelay(const SendState& state);

}  // namespace taclink::server
