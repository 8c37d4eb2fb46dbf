#pragma once

#include <cstdint>

#include "sensing/core/clock.h"
#include "sensing/core/result.h"

namespace taclink::server {

/// A client's time of an instant as the server's monotonic one. One of the two is given, the other 0. Errors:
/// kInvalidArgument (none is given, or more than 20 ms ahead of the clock or 10 s behind).
Result<int64_t> MonotonicOf(int64_t utc_ns, int64_t monotonic_ns, const Clock& clock);

/// "0.250 s"
std::string SecondsText(int64_t ns);

}  // namespace taclink::server
