#include "server/log.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/formatter.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/basic_file_sink.h>
#include <spdlog/sinks/dist_sink.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <ctime>
#include <exception>
#include <map>
#include <mutex>
#include <string_view>

namespace taclink::server {
namespace {

constexpr std::string_view kLinkPrefix = "link ";
constexpr std::chrono::minutes kWindow{1};
constexpr size_t kMostKeys = 512;

thread_local const LogEvent* current_event = nullptr;

// The name in "link NAME: ...", or nothing.
std::string_view LinkOf(std::string_view message) {
  if (!message.starts_with(kLinkPrefix)) return {};
  const auto colon = message.find(": ");
  const auto space = message.find(' ', kLinkPrefix.size());
  if (colon == std::string_view::npos || space < colon) return {};
  return message.substr(kLinkPrefix.size(), colon - kLinkPrefix.size());
}

void AppendText(spdlog::memory_buf_t& out, std::string_view text) {
  out.push_back('"');
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out.push_back('\\');
      out.push_back(c);
    } else if (static_cast<unsigned char>(c) < 0x20) {
      fmt::format_to(std::back_inserter(out), "\\u{:04x}", static_cast<int>(c));
    } else {
      out.push_back(c);
    }
  }
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
    if (!link.empty()) message.remove_prefix(kLinkPrefix.size() + link.size() + 2);
    fmt::format_to(std::back_inserter(dest), "{{\"ts\":\"{:%Y-%m-%dT%H:%M:%S}.{:03}Z\"",
                   fmt::gmtime(static_cast<std::time_t>(ms / 1000)), ms % 1000);
    const auto level = spdlog::level::to_string_view(msg.level);
    AppendMember(dest, "level", {level.data(), level.size()});
    if (!link.empty()) AppendMember(dest, "link", link);
    const LogEvent* const event = LogEvent::Current();
    if (event != nullptr) AppendMember(dest, "event", event->name());
    AppendMember(dest, "message", message);
    if (event != nullptr) {
      for (const auto& [key, value] : event->numbers())
        if (std::isfinite(value)) fmt::format_to(std::back_inserter(dest), ",\"{}\":{}", key, value);
    }
    constexpr std::string_view kEnd = "}\n";
    dest.append(kEnd.data(), kEnd.data() + kEnd.size());
  }
  std::unique_ptr<spdlog::formatter> clone() const override { return std::make_unique<JsonFormatter>(); }
};

/// Keeps a table of messages without their numbers; link names keep theirs.
class LimitedSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  LimitedSink(std::shared_ptr<spdlog::sinks::sink> inner, int a_minute)
      : sink_(std::move(inner)), a_minute_(a_minute) {}

 private:
  using Time = spdlog::log_clock::time_point;
  struct Entry {
    Time begin;
    int passed = 0;
    uint64_t suppressed = 0;
    spdlog::level::level_enum level = spdlog::level::info;
    std::string last;
  };

  static std::string Key(const spdlog::details::log_msg& msg) {
    const std::string_view message(msg.payload.data(), msg.payload.size());
    const size_t kept = LinkOf(message).size();
    std::string key = std::to_string(static_cast<int>(msg.level)) +
                      std::string(message.substr(0, kLinkPrefix.size() + kept));
    for (const char c : message.substr(std::min(message.size(), kLinkPrefix.size() + kept)))
      if (c < '0' || c > '9') key += c;
    return key;
  }

  void sink_it_(const spdlog::details::log_msg& msg) override {
    Sweep(msg.time);
    auto found = entries_.find(Key(msg));
    if (found == entries_.end()) {
      if (entries_.size() >= kMostKeys) return sink_->log(msg);  // no more memory than that
      found = entries_.emplace(Key(msg), Entry{.begin = msg.time, .level = msg.level, .last = {}}).first;
    }
    Entry& entry = found->second;
    if (++entry.passed <= a_minute_) return sink_->log(msg);
    ++entry.suppressed;
    entry.last.assign(msg.payload.data(), msg.payload.size());
  }

  // Forgets what is older than the window, and says what it swallowed.
  void Sweep(Time now) {
    for (auto at = entries_.begin(); at != entries_.end();) {
      if (now - at->second.begin < kWindow) {
        ++at;
        continue;
      }
      if (at->second.suppressed > 0) {
        const std::string text =
            fmt::format("{} (suppressed {} times)", at->second.last, at->second.suppressed);
        spdlog::details::log_msg told("", at->second.level, text);
        told.time = now;
        sink_->log(told);
      }
      at = entries_.erase(at);
    }
  }

  void flush_() override {
    Sweep(spdlog::log_clock::now());
    sink_->flush();
  }
  void set_pattern_(const std::string& pattern) override { sink_->set_pattern(pattern); }
  void set_formatter_(std::unique_ptr<spdlog::formatter> formatter) override {
    sink_->set_formatter(std::move(formatter));
  }

  const std::shared_ptr<spdlog::sinks::sink> sink_;
  const int a_minute_;
  std::map<std::string, Entry> entries_;  // by message without numbers; guarded by base_sink's mutex
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

std::shared_ptr<spdlog::sinks::sink> LimitRate(std::shared_ptr<spdlog::sinks::sink> sink, int a_minute) {
  if (a_minute == 0) return sink;
  return std::make_shared<LimitedSink>(std::move(sink), a_minute);
}

std::unique_ptr<spdlog::formatter> JsonLines() {
  return std::make_unique<JsonFormatter>();
}

Result<void> SetUpLog(const LogOptions& options) {
  std::shared_ptr<spdlog::sinks::sink> sink;
  try {
    if (options.file.empty()) {
      sink = std::make_shared<spdlog::sinks::stderr_color_sink_mt>();
    } else {
      sink = std::make_shared<spdlog::sinks::basic_file_sink_mt>(options.file);
    }
  } catch (const spdlog::spdlog_ex& e) {
    return Error{ErrorCode::kUnavailable, "log.file: " + std::string(e.what())};
  }
  if (options.format == LogFormat::kJson) {
    sink->set_formatter(JsonLines());
  } else {
    sink->set_pattern("%Y-%m-%dT%H:%M:%S.%e%z %^%l%$ %v");
  }
  // The logger stays, for other threads may be in it: only where it writes to changes, under a lock.
  static const auto kOutlet = std::make_shared<spdlog::sinks::dist_sink_mt>();
  static const auto kLogger = std::make_shared<spdlog::logger>("taclinkd", kOutlet);
  kOutlet->set_sinks({LimitRate(std::move(sink), options.rate_limit)});
  kLogger->set_level(spdlog::level::from_str(options.level));
  kLogger->flush_on(options.file.empty() ? spdlog::level::off : spdlog::level::info);
  if (spdlog::default_logger() != kLogger) spdlog::set_default_logger(kLogger);
  return {};
}

}  // namespace taclink::server
