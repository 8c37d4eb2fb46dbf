#include "server/process/send_delay.h"

#include <linux/sockios.h>
#include <linux/tcp.h>
#include <netinet/in.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>

namespace taclink::server {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

constexpr double kAlwaysQueuedBytes = 3000;  // two segments: the first may be acknowledged with the second
constexpr milliseconds kShortest{5}, kLongest{100};  // until the state is looked at again

double Seconds(microseconds time) {
  return std::chrono::duration<double>(time).count();
}

}  // namespace

milliseconds SendDelay(const SendState& state) {
  const microseconds soon = state.shortest_round_trip + kMostQueued;
  // The rate says nothing of a link that stalls, nor, where a router takes bursts at once, of how fast that
  // router sends them on.
  const bool known =
      state.since_acknowledgement <= soon + kMostQueued && state.round_trip <= soon + 2 * kMostQueued;
  const double delivered_soon = known ? state.bytes_per_s * Seconds(soon) : 0;
  const double surplus = state.queued_bytes - std::max(kAlwaysQueuedBytes, delivered_soon);
  if (surplus <= 0) return milliseconds(0);
  if (state.bytes_per_s <= 0) return kShortest;
  const double wait_ms = surplus / state.bytes_per_s * 1e3;
  return milliseconds(static_cast<int64_t>(
      std::clamp(wait_ms, static_cast<double>(kShortest.count()), static_cast<double>(kLongest.count()))));
}

milliseconds SendDelay(int socket) {
  int queued_bytes = 0;
  if (::ioctl(socket, SIOCOUTQ, &queued_bytes) != 0 || queued_bytes <= kAlwaysQueuedBytes)
    return milliseconds(0);
  tcp_info info{};
  socklen_t size = sizeof info;
  if (::getsockopt(socket, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return milliseconds(0);
  return SendDelay({.queued_bytes = static_cast<double>(queued_bytes),
                    .bytes_per_s = static_cast<double>(info.tcpi_delivery_rate),
                    .shortest_round_trip = microseconds(info.tcpi_min_rtt),
                    .round_trip = microseconds(info.tcpi_rtt),
                    .since_acknowledgement = milliseconds(info.tcpi_last_ack_recv)});
}

}  // namespace taclink::server
