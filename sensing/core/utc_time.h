#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace taclink {

/// Seconds since 1970-01-01 UTC of "2027-01-31T00:00:00Z", or of "2027-01-31", which is its first moment.
/// None: it is neither.
std::optional<int64_t> ParseUtc(std::string_view text);

/// "2027-01-31T00:00:00Z".
std::string UtcText(int64_t utc_s);

}  // namespace taclink
