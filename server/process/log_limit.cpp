#include "server/process/log_limit.h"

#include <fmt/format.h>
#include <spdlog/sinks/base_sink.h>

#include <chrono>
#include <map>
#include <mutex>
#include <string>
#include <utility>

#include "sensing/core/printable.h"
#include "server/process/log.h"

namespace taclink::server {
namespace {

using spdlog::details::log_msg;

constexpr std::string_view kLinkPrefix = "link ";
constexpr std::chrono::minutes kWindow{1};
constexpr size_t kMostSources = 100;    // of one place, that are told apart
constexpr size_t kMostTold = 100;       // kinds whose count is told by itself
constexpr size_t kMostKeyBytes = 100;   // of a source, or of a message that tells no place
constexpr size_t kMostKeptBytes = 512;  // of a message that was suppressed

std::string_view TextOf(const log_msg& msg) {
  return {msg.payload.data(), msg.payload.size()};
}

// Who a message is about: a link, a peer without its port, a part of the server.
std::string_view SourceOf(std::string_view message) {
  const auto colon = message.find(": ");
  if (colon == std::string_view::npos) return {};
  std::string_view source = message.substr(0, colon);
  if (LinkOf(message).empty()) source = source.substr(0, source.rfind(':'));
  return source.substr(0, kMostKeyBytes);
}

std::string WithoutNumbers(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, kMostKeyBytes))
    if (c < '0' || c > '9') out += c;
  return out;
}

// Errors sort before what matters less.
std::string LevelKey(const log_msg& msg) {
  return std::string(1, static_cast<char>('9' - static_cast<int>(msg.level)));
}

class LimitedSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  LimitedSink(std::shared_ptr<spdlog::sinks::sink> inner, const LogRates& rates)
      : sink_(std::move(inner)), rates_(rates) {}
  ~LimitedSink() override {
    try {
      Tell(spdlog::log_clock::now());
      sink_->flush();
    } catch (const std::exception&) {  // a full disk, say: nobody is left to be told
    }
  }

 private:
  using Time = spdlog::log_clock::time_point;
  /// Messages of one place about one source.
  struct Kind {
    int passed = 0;
    size_t suppressed = 0;
    // Of the last one that was suppressed.
    spdlog::level::level_enum level = spdlog::level::info;
    const char* event = nullptr;
    std::string text;
  };

  void sink_it_(const log_msg& msg) override {
    Turn(msg.time);
    const bool first_of_site = !msg.source.empty() && !sources_.contains(SiteOf(msg));
    Kind& kind = KindOf(msg);
    if ((first_of_site || HasRoom(msg.level)) && (rates_.per_site == 0 || kind.passed < rates_.per_site)) {
      ++passed_;
      ++kind.passed;
      return sink_->log(msg);
    }
    ++kind.suppressed;
    kind.level = msg.level;
    kind.event = LogEvent::Current() == nullptr ? nullptr : LogEvent::Current()->name();
    const CutText cut = Cut(TextOf(msg), kMostKeptBytes);
    kind.text.assign(cut.kept).append(cut.told);
  }

  bool HasRoom(spdlog::level::level_enum level) const {
    const int kept = level >= spdlog::level::warn ? 0 : rates_.total / 4;
    return rates_.total == 0 || passed_ < rates_.total - kept;
  }

  static std::string SiteOf(const log_msg& msg) {
    return LevelKey(msg) +
           (msg.source.empty() ? "" : fmt::format("{}:{}", msg.source.filename, msg.source.line));
  }

  // Too many sources at one place, as those of forged addresses, count as one: memory is bounded by the size
  // of the program, and they take no place from others.
  Kind& KindOf(const log_msg& msg) {
    const std::string site = SiteOf(msg);
    std::string key = site;
    key.append(" ").append(SourceOf(TextOf(msg)));
    if (msg.source.empty()) key += WithoutNumbers(TextOf(msg));
    const auto found = kinds_.find(key);
    if (found != kinds_.end()) return found->second;
    return kinds_[sources_[site]++ < kMostSources ? key : site];
  }

  // Begins a new minute when this one is over, or the clock was set back.
  void Turn(Time now) {
    if (now >= begin_ && now - begin_ < kWindow) return;
    Tell(now);
    begin_ = now;
    passed_ = 0;
    kinds_.clear();
    sources_.clear();
  }

  void Tell(Time now) {
    size_t told = 0, other_kinds = 0, others = 0;
    for (const auto& [key, kind] : kinds_) {
      if (kind.suppressed == 0) continue;
      if (told++ < kMostTold) {
        Say(now, kind, fmt::format("{} (… {} more)", kind.text, WithCommas(kind.suppressed)));
      } else {
        ++other_kinds;
        others += kind.suppressed;
      }
    }
    if (others > 0)
      Say(now, {.suppressed = others, .text = {}},
          fmt::format("… {} more of {} other kinds", WithCommas(others), WithCommas(other_kinds)));
  }

  void Say(Time now, const Kind& kind, const std::string& text) {
    const LogEvent event(kind.event, {{"more", static_cast<double>(kind.suppressed)}});
    log_msg msg("", kind.level, text);
    msg.time = now;
    sink_->log(msg);
  }

  void flush_() override {
    Turn(spdlog::log_clock::now());
    sink_->flush();
  }
  void set_pattern_(const std::string& pattern) override { sink_->set_pattern(pattern); }
  void set_formatter_(std::unique_ptr<spdlog::formatter> formatter) override {
    sink_->set_formatter(std::move(formatter));
  }

  const std::shared_ptr<spdlog::sinks::sink> sink_;
  const LogRates rates_;
  // Guarded by base_sink's mutex; of the minute since begin_.
  Time begin_;
  int passed_ = 0;
  std::map<std::string, Kind> kinds_;
  std::map<std::string, size_t> sources_;  // by place
};

}  // namespace

std::string_view LinkOf(std::string_view message) {
  if (!message.starts_with(kLinkPrefix)) return {};
  const auto colon = message.find(": ");
  const auto space = message.find(' ', kLinkPrefix.size());
  if (colon == std::string_view::npos || space < colon) return {};
  return message.substr(kLinkPrefix.size(), colon - kLinkPrefix.size());
}

std::shared_ptr<spdlog::sinks::sink> LimitRate(std::shared_ptr<spdlog::sinks::sink> sink,
                                               const LogRates& rates) {
  if (rates.per_site == 0 && rates.total == 0) return sink;
  return std::make_shared<LimitedSink>(std::move(sink), rates);
}

}  // namespace taclink::server
