#include "server/process/log.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/basic_file_sink.h>
#include <spdlog/sinks/dist_sink.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <ctime>
#include <filesystem>
#include <string_view>

#include "sensing/core/printable.h"

namespace taclink::server {
namespace {

thread_local const LogEvent* current_event = nullptr;

void Append(spdlog::memory_buf_t& out, std::string_view text) {
  out.append(text.data(), text.data() + text.size());
}

// JSON knows no bytes that are no text: they become what Printable makes of them.
void AppendPiece(spdlog::memory_buf_t& out, const TextPiece& piece) {
  if (!piece.code) return Append(out, "\\" + Printable(piece.bytes));
  if (piece.code == U'"' || piece.code == U'\\') out.push_back('\\');
  if (!IsControl(*piece.code)) return Append(out, piece.bytes);
  fmt::format_to(std::back_inserter(out), "\\u{:04x}", static_cast<unsigned>(*piece.code));
}

void AppendText(spdlog::memory_buf_t& out, std::string_view text) {
  const CutText cut = Cut(text, kMostMessageBytes);
  out.push_back('"');
  for (std::string_view rest = cut.kept; !rest.empty();) {
    const TextPiece piece = FirstPiece(rest);
    rest.remove_prefix(piece.bytes.size());
    AppendPiece(out, piece);
  }
  Append(out, cut.told);
  out.push_back('"');
}

void AppendMember(spdlog::memory_buf_t& out, std::string_view key, std::string_view text) {
  fmt::format_to(std::back_inserter(out), ",\"{}\":", key);
  AppendText(out, text);
}

class JsonFormatter final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& msg, spdlog::memory_buf_t& dest) override {
    using std::chrono::milliseconds;
    const auto since = msg.time.time_since_epoch();
    const auto ms = std::chrono::duration_cast<milliseconds>(since).count();
    std::string_view message(msg.payload.data(), msg.payload.size());
    const std::string_view link = LinkOf(message);
    if (!link.empty()) message.remove_prefix(message.find(": ") + 2);
    fmt::format_to(std::back_inserter(dest), "{{\"ts\":\"{:%Y-%m-%dT%H:%M:%S}.{:03}Z\"",
                   fmt::gmtime(static_cast<std::time_t>(ms / 1000)), ms % 1000);
    const auto level = spdlog::level::to_string_view(msg.level);
    AppendMember(dest, "level", {level.data(), level.size()});
    if (!link.empty()) AppendMember(dest, "link", link);
    const LogEvent* const event = LogEvent::Current();
    if (event != nullptr && event->name() != nullptr) AppendMember(dest, "event", event->name());
    AppendMember(dest, "message", message);
    if (event != nullptr) {
      for (const auto& [key, value] : event->numbers())
        if (std::isfinite(value)) fmt::format_to(std::back_inserter(dest), ",\"{}\":{}", key, value);
    }
    Append(dest, "}\n");
  }
  std::unique_ptr<spdlog::formatter> clone() const override { return std::make_unique<JsonFormatter>(); }
};

class PrintableMessage final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& msg, const std::tm&, spdlog::memory_buf_t& dest) override {
    Append(dest, Printable({msg.payload.data(), msg.payload.size()}, kMostMessageBytes));
  }
  std::unique_ptr<spdlog::custom_flag_formatter> clone() const override {
    return std::make_unique<PrintableMessage>();
  }
};

}  // namespace

LogEvent::LogEvent(const char* name, std::initializer_list<Number> numbers)
    : name_(name), numbers_(numbers), outer_(current_event) {
  current_event = this;
}

LogEvent::~LogEvent() {
  current_event = outer_;
}

const LogEvent* LogEvent::Current() {
  return current_event;
}

std::unique_ptr<spdlog::formatter> TextLines() {
  auto lines = std::make_unique<spdlog::pattern_formatter>();
  lines->add_flag<PrintableMessage>('*').set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %^%l%$ %*");
  return lines;
}

std::unique_ptr<spdlog::formatter> JsonLines() {
  return std::make_unique<JsonFormatter>();
}

Result<void> SetUpLog(const LogOptions& options) {
  std::shared_ptr<spdlog::sinks::sink> sink;
  try {
    if (options.file.empty()) {
      sink = std::make_shared<spdlog::sinks::stderr_color_sink_mt>();
    } else if (std::error_code error; std::filesystem::exists(options.file, error) &&
                                      !std::filesystem::is_regular_file(options.file, error)) {
      return Error{ErrorCode::kInvalidArgument, "log.file: " + options.file + " is no regular file"};
    } else {
      sink = std::make_shared<spdlog::sinks::basic_file_sink_mt>(options.file);
    }
  } catch (const spdlog::spdlog_ex& e) {
    return Error{ErrorCode::kUnavailable, "log.file: " + std::string(e.what())};
  }
  sink->set_formatter(options.format == LogFormat::kJson ? JsonLines() : TextLines());
  // The logger stays, for other threads may be in it: only where it writes to changes, under a lock.
  static const auto kOutlet = std::make_shared<spdlog::sinks::dist_sink_mt>();
  static const auto kLogger = std::make_shared<spdlog::logger>("taclinkd", kOutlet);
  kOutlet->set_sinks({LimitRate(std::move(sink), options.rates)});
  kLogger->set_level(spdlog::level::from_str(options.level));
  kLogger->flush_on(options.file.empty() ? spdlog::level::off : spdlog::level::info);
  if (spdlog::default_logger() != kLogger) spdlog::set_default_logger(kLogger);
  return {};
}

}  // namespace taclink::server
