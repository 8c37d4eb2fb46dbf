#pragma once

#include <spdlog/sinks/sink.h>

#include <array>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sensing/core/result.h"

namespace taclink::server {

enum class LogFormat { kText, kJson };

struct LogOptions {
  std::string level = "info";  ///< one of kLogLevels
  LogFormat format = LogFormat::kText;
  std::string file = {};  ///< appended to; empty: standard error
  int rate_limit = 10;    ///< messages a minute that differ in their numbers only; 0: no limit
};
inline constexpr std::array<std::string_view, 4> kLogLevels = {"debug", "info", "warning", "error"};

/// Sends what spdlog's functions are told where `options` say. A message that begins with "link NAME: " is
/// that link's. May be called again; a file is opened anew, as log rotation wants it. Errors: kUnavailable
/// (file).
Result<void> SetUpLog(const LogOptions& options);

/// Before a sink: lets `a_minute` messages through that differ in their numbers only, then counts, and tells
/// the count when their minute is over, with the next message of any kind or a flush.
std::shared_ptr<spdlog::sinks::sink> LimitRate(std::shared_ptr<spdlog::sinks::sink> sink, int a_minute);

/// One JSON object a line: ts (UTC, RFC 3339), level, link, event, message, numbers.
std::unique_ptr<spdlog::formatter> JsonLines();

/// What this thread logs while it lives is about this event and carries these numbers.
class LogEvent {
 public:
  using Number = std::pair<const char*, double>;
  explicit LogEvent(const char* name, std::initializer_list<Number> numbers = {});
  ~LogEvent();
  LogEvent(const LogEvent&) = delete;
  LogEvent& operator=(const LogEvent&) = delete;

  /// The innermost of this thread; null: none.
  static const LogEvent* Current();
  const char* name() const { return name_; }
  const std::vector<Number>& numbers() const { return numbers_; }

 private:
  const char* const name_;
  const std::vector<Number> numbers_;
  const LogEvent* const outer_;
};

}  // namespace taclink::server
