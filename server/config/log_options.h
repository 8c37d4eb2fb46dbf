#pragma once

#include <array>
#include <string>
#include <string_view>

namespace taclink::server {

/// Messages that a log takes in a minute; 0: no limit.
struct LogRates {
  int per_site = 10;  ///< of one place of the program about one source
  /// Of all; a quarter is kept for warnings and errors, and the first message of each place is taken beyond.
  int total = 600;
};

enum class LogFormat { kText, kJson };

struct LogOptions {
  std::string level = "info";  ///< one of kLogLevels
  LogFormat format = LogFormat::kText;
  std::string file = {};  ///< appended to; empty: standard error
  LogRates rates = {};
};
inline constexpr std::array<std::string_view, 4> kLogLevels = {"debug", "info", "warning", "error"};

}  // namespace taclink::server
