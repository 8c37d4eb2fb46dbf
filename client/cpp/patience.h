#pragma once

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>
#include <system_error>

#include "sensing/core/result.h"

namespace taclink::client {

// Internal to the library.

/// `usual`, or what the environment variable TACLINK_PATIENCE_S says where that is more; not set and empty
/// are the same. More than a day counts as a day. Errors: kInvalidArgument (not a positive number).
inline Result<std::chrono::milliseconds> PatienceFromEnvironment(std::chrono::milliseconds usual) {
  constexpr double kMostSeconds = 86'400;                       // far below what deadlines can hold
  const char* const found = std::getenv("TACLINK_PATIENCE_S");  // NOLINT(concurrency-mt-unsafe): only read
  const std::string_view text = found == nullptr ? std::string_view() : found;
  if (text.empty()) return usual;
  double seconds = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, seconds);
  if (error != std::errc() || stop != end || !std::isfinite(seconds) || seconds <= 0)
    return Error{ErrorCode::kInvalidArgument, "the environment variable TACLINK_PATIENCE_S is '" +
                                                  std::string(text) +
                                                  "', but must be a positive number of seconds, such as 60"};
  const std::chrono::duration<double> patience(std::min(seconds, kMostSeconds));
  return std::max(usual, std::chrono::duration_cast<std::chrono::milliseconds>(patience));
}

}  // namespace taclink::client
