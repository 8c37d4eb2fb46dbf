#pragma once

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cstdint>
#include <ctime>
#include <string>

namespace taclink::command {

/// "2026-11-22 12:01:37.250 UTC"; ns since 1970-01-01.
inline std::string UtcText(uint64_t ns) {
  const auto seconds = static_cast<std::time_t>(ns / 1'000'000'000);
  return fmt::format("{:%Y-%m-%d %H:%M:%S}.{:03} UTC", fmt::gmtime(seconds), ns / 1'000'000 % 1000);
}

/// "812 bytes", "12.3 kB", "45.6 MB".
inline std::string SizeText(uint64_t bytes) {
  const auto number = static_cast<double>(bytes);
  if (bytes < 10'000) return fmt::format("{} bytes", bytes);
  if (bytes < 10'000'000) return fmt::format("{:.1f} kB", number * 1e-3);
  return bytes < 10'000'000'000 ? fmt::format("{:.1f} MB", number * 1e-6)
                                : fmt::format("{:.1f} GB", number * 1e-9);
}

}  // namespace taclink::command
