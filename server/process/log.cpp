#include "server/process/log.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/details/os.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/dist_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <atomic>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <mutex>
#include <string>
#include <string_view>
#include <system_error>

#include "sensing/core/printable.h"
#include "server/process/log_writer.h"

namespace taclink::server {
namespace {

thread_local const LogEvent* current_event = nullptr;

constexpr std::chrono::seconds kReopenLimit{1};

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

std::unique_ptr<spdlog::formatter> LinesAs(LogFormat format) {
  return format == LogFormat::kJson ? JsonLines() : TextLines();
}

std::string_view ColorOf(spdlog::level::level_enum level) {
  switch (level) {
    case spdlog::level::debug:
      return "\033[36m";
    case spdlog::level::info:
      return "\033[32m";
    case spdlog::level::warn:
      return "\033[33m\033[1m";
    default:
      return "\033[31m\033[1m";
  }
}

/// Formats on the calling thread, which never waits for the output.
class WriterSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  WriterSink(std::shared_ptr<LogWriter> writer, std::unique_ptr<spdlog::formatter> lines, bool is_colored)
      : base_sink(std::move(lines)), writer_(std::move(writer)), is_colored_(is_colored) {}
  void WaitForWrites(std::chrono::milliseconds limit) { writer_->Flush(limit); }

 private:
  void sink_it_(const spdlog::details::log_msg& msg) override {
    spdlog::memory_buf_t line;
    msg.color_range_start = msg.color_range_end = 0;
    formatter_->format(msg, line);
    std::string text(line.data(), line.size());
    if (is_colored_ && msg.color_range_end > msg.color_range_start) {
      text.insert(msg.color_range_end, "\033[m");
      text.insert(msg.color_range_start, ColorOf(msg.level));
    }
    writer_->Push(std::move(text));
  }
  void flush_() override {}  // the writer holds nothing back

  const std::shared_ptr<LogWriter> writer_;
  const bool is_colored_;
};

/// Never destroyed: threads may log until the process has ended.
struct LogOutlet {
  const std::shared_ptr<spdlog::sinks::dist_sink_mt> sinks = std::make_shared<spdlog::sinks::dist_sink_mt>();
  // The logger stays, because other threads may be in it: only its sinks change, under a lock.
  const std::shared_ptr<spdlog::logger> logger = std::make_shared<spdlog::logger>("taclinkd", sinks);
  std::mutex mutex;
  std::shared_ptr<WriterSink> writing;  // guarded by the mutex
};

LogOutlet& Outlet() {
  static LogOutlet& outlet = *new LogOutlet;
  return outlet;
}

std::atomic<LogFormat> count_format = LogFormat::kText;

std::string CountOfLeftOut(const LeftOutLines& lines) {
  const std::string why = lines.error == 0
                              ? "the log was not read"
                              : "writing failed (" + std::generic_category().message(lines.error) + ")";
  const std::string text =
      fmt::format("… {} log {} left out: {} for {:.1f} s", WithCommas(lines.count),
                  lines.count == 1 ? "line was" : "lines were", why, lines.during.count());
  const LogEvent event("log_left_out", {{"lines", static_cast<double>(lines.count)}});
  spdlog::memory_buf_t line;
  LinesAs(count_format)->format({"", spdlog::level::warn, text}, line);
  return {line.data(), line.size()};
}

// One for standard error, whose lines keep their order when the log is set up again; one for each file
// opened.
Result<std::shared_ptr<LogWriter>> WriterFor(const LogOptions& options) {
  try {
    if (options.file.empty()) {
      static auto& to_stderr =
          *new std::shared_ptr(std::make_shared<LogWriter>(ToDescriptor(STDERR_FILENO), CountOfLeftOut));
      return to_stderr;
    }
    auto file = ToFile(options.file);
    if (!file) return file.error();
    return std::make_shared<LogWriter>(std::move(*file), CountOfLeftOut);
  } catch (const std::exception& e) {  // no thread
    return Error{ErrorCode::kUnavailable, "the log cannot be written: " + std::string(e.what())};
  }
}

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

void EndLog(std::chrono::milliseconds limit) {
  LogOutlet& outlet = Outlet();
  const std::lock_guard lock(outlet.mutex);
  if (!outlet.writing) return;
  outlet.sinks->set_sinks({outlet.writing});  // the end of the rate limit tells what it has suppressed
  outlet.writing->WaitForWrites(limit);
}

Result<void> SetUpLog(const LogOptions& options) {
  auto writer = WriterFor(options);
  if (!writer) return Error{writer.error().code, "log.file: " + writer.error().message};
  const bool is_colored = options.file.empty() && spdlog::details::os::in_terminal(stderr) &&
                          spdlog::details::os::is_color_terminal();
  count_format = options.format;
  const auto sink = std::make_shared<WriterSink>(std::move(*writer), LinesAs(options.format), is_colored);
  LogOutlet& outlet = Outlet();
  const std::lock_guard lock(outlet.mutex);
  // A file that is opened again gets its lines in their order.
  if (outlet.writing) outlet.writing->WaitForWrites(kReopenLimit);
  outlet.writing = sink;
  outlet.sinks->set_sinks({LimitRate(sink, options.rates)});
  outlet.logger->set_level(spdlog::level::from_str(options.level));
  if (spdlog::default_logger() != outlet.logger) spdlog::set_default_logger(outlet.logger);
  return {};
}

}  // namespace taclink::server
