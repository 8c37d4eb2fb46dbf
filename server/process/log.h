#pragma once

#include <spdlog/sinks/sink.h>

#include <array>
#include <chrono>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sensing/core/result.h"
#include "server/process/log_limit.h"

namespace taclink::server {

/// Sends what spdlog's macros (SPDLOG_INFO and so on, which tell where they stand) are told where `options`
/// say. May be called again; a file is reopened, as log rotation wants it. No caller of the macros waits for
/// the output: a LogWriter writes. Errors: kInvalidArgument, kUnavailable (file).
Result<void> SetUpLog(const LogOptions& options);

/// For the end of the process: tells what the rate limit has suppressed so far, lifts the limit, and waits
/// until all lines are written, but no longer than `limit`. Does nothing before SetUpLog.
void EndLog(std::chrono::milliseconds limit = std::chrono::seconds(1));

/// A line for each message, whatever is in it: what a terminal or a reader of lines could take for more than
/// text is escaped, and a message of more than 4 KiB cut. TextLines: time, level, message. JsonLines: an
/// object with ts (UTC, RFC 3339), level, link, event, message, numbers.
std::unique_ptr<spdlog::formatter> TextLines();
std::unique_ptr<spdlog::formatter> JsonLines();

/// What this thread logs while it lives is about this event (null: none) and carries these numbers.
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
