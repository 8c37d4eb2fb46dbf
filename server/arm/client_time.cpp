#include "server/arm/client_time.h"

#include <cstdio>
#include <string>

namespace taclink::server {
namespace {

// Nothing arrives before it was measured: a time ahead of the clock shows that the clocks differ, so that all
// that this client sends is dated wrong. Synchronised clocks differ by some milliseconds.
constexpr int64_t kMostAheadNs = 20'000'000;
constexpr int64_t kMostBehindNs = 10'000'000'000;

Error InvalidTime(std::string what) {
  return {ErrorCode::kInvalidArgument, std::move(what)};
}

}  // namespace

std::string SecondsText(int64_t ns) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3f s", static_cast<double>(ns) * 1e-9);
  return text;
}

Result<int64_t> MonotonicOf(int64_t utc_ns, int64_t monotonic_ns, const Clock& clock) {
  const bool utc = utc_ns != 0;
  const int64_t stamp_ns = utc ? utc_ns : monotonic_ns;
  if (stamp_ns <= 0)
    return InvalidTime("no time; give utc_ns (since 1970) or monotonic_ns (of the server's machine)");
  const int64_t now_ns = clock.MonotonicNs();
  const int64_t ahead_ns = stamp_ns - (utc ? clock.UtcNs() : now_ns);
  const std::string clocks = utc ? "; synchronise the clocks" : "; is it the server's monotonic clock?";
  if (ahead_ns > kMostAheadNs)
    return InvalidTime("its time is " + SecondsText(ahead_ns) + " ahead of the server's clock" + clocks);
  if (ahead_ns < -kMostBehindNs)
    return InvalidTime("its time is " + SecondsText(-ahead_ns) + " behind the server's clock" + clocks);
  return now_ns + ahead_ns;
}

}  // namespace taclink::server
