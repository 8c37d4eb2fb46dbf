#include "client/command/logs/log_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <regex>

#include "client/command/cli/csv.h"
#include "client/command/cli/log_text.h"
#include "wire/log/topics.h"

namespace taclink::command {
namespace {

constexpr size_t kMostNotes = 1000;
constexpr size_t kShownNotes = 10;
constexpr double kMostSeconds = 1e9;  // a time of a log in ns stays exact as far as a double can

Error Wrong(std::string message) {
  return {ErrorCode::kInvalidArgument, std::move(message)};
}

template <typename T>
T Number(const std::ssub_match& digits) {
  T value = 0;
  ParseWhole(digits.str(), value);
  return value;
}

std::optional<uint64_t> ParseUtc(const std::string& text) {
  static const std::regex kForm(R"((\d{4})-(\d\d)-(\d\d)[T ](\d\d):(\d\d):(\d\d)(?:\.(\d{1,9}))?(?:Z| UTC))");
  std::smatch match;
  if (!std::regex_match(text, match, kForm)) return std::nullopt;
  const std::chrono::year_month_day date(std::chrono::year(Number<int>(match[1])),
                                         std::chrono::month(Number<unsigned>(match[2])),
                                         std::chrono::day(Number<unsigned>(match[3])));
  const auto hour = Number<int64_t>(match[4]), minute = Number<int64_t>(match[5]),
             second = Number<int64_t>(match[6]);
  constexpr int kFirstYear = 1970, kLastYear = 2500;
  const int year = static_cast<int>(date.year());
  if (!date.ok() || year < kFirstYear || year > kLastYear || hour > 23 || minute > 59 || second > 60)
    return std::nullopt;
  std::string fraction = match[7].str();
  fraction.resize(9, '0');
  uint64_t ns = 0;
  ParseWhole(fraction, ns);
  const int64_t days = std::chrono::sys_days(date).time_since_epoch().count();
  return static_cast<uint64_t>(((days * 24 + hour) * 60 + minute) * 60 + second) * 1'000'000'000 + ns;
}

void PrintNotes(const std::set<std::string>& notes) {
  size_t shown = 0;
  for (const std::string& note : notes) {
    if (++shown > kShownNotes) break;
    fmt::print(stderr, "  left out: {}\n", note);
  }
  if (notes.size() > kShownNotes) fmt::print(stderr, "  and {} more\n", notes.size() - kShownNotes);
}

std::string Span(const mcap::Statistics& statistics) {
  return fmt::format("{} to {} ({:.3f} s)", UtcText(statistics.message_start_ns),
                     UtcText(statistics.message_end_ns),
                     static_cast<double>(statistics.message_end_ns - statistics.message_start_ns) * 1e-9);
}

Result<void> ChooseRange(const LogSource& source, const PartOptions& options, LogPart& part) {
  if (options.from.empty() && options.to.empty()) return {};
  const mcap::Statistics& statistics = source.reader().statistics();
  if (statistics.message_count == 0)
    return Wrong(source.file() + ": holds no messages; leave --from and --to out");
  uint64_t end_ns = UINT64_MAX;
  for (auto& [text, name, value] : std::array<std::tuple<const std::string&, const char*, uint64_t&>, 2>{
           {{options.from, "--from", part.start_ns}, {options.to, "--to", end_ns}}}) {
    if (text.empty()) continue;
    const auto time = ParseLogTime(text, statistics.message_start_ns);
    if (!time) return Wrong(fmt::format("{}: {}", name, time.error().message));
    value = *time;
  }
  if (part.start_ns >= end_ns)
    return Wrong(fmt::format("--from {} is not before --to {}; give an earlier --from",
                             options.from.empty() ? "the start" : options.from, options.to));
  if (!options.to.empty()) part.end_ns = end_ns - 1;
  if (part.start_ns > statistics.message_end_ns || part.end_ns < statistics.message_start_ns)
    return Wrong(fmt::format("{}: holds nothing between --from and --to; it goes from {}", source.file(),
                             Span(statistics)));
  return {};
}

Result<void> ChooseLinks(const LogSource& source, const PartOptions& options, LogPart& part) {
  std::set<std::string> known;
  for (const auto& [id, channel] : source.reader().channels()) {
    if (std::string link = LinkOf(channel); !link.empty()) known.insert(std::move(link));
  }
  for (const std::string& link : options.links) {
    if (!known.contains(link)) {
      return Error{ErrorCode::kNotFound,
                   fmt::format("{}: has no link '{}'; {}", source.file(), link,
                               known.empty() ? "it has none" : "there are: " + Joined(known))};
    }
    part.links.insert(link);
  }
  return {};
}

}  // namespace

Result<std::unique_ptr<LogSource>> LogSource::Open(const std::string& file) {
  auto bytes = mcap::FileSource::Open(file);
  if (!bytes) return bytes.error();
  auto reader = mcap::Reader::Open(std::move(*bytes));
  if (!reader) return Error{reader.error().code, file + ": " + reader.error().message};
  return std::unique_ptr<LogSource>(new LogSource(file, std::move(*reader)));
}

void LogSource::NoteDamage(const std::string& what) {
  if (damage_.size() < kMostNotes) damage_.insert(what);
}

void LogSource::NoteLeftOut(const std::string& what) {
  if (left_out_.size() < kMostNotes) left_out_.insert(what);
}

Result<void> LogSource::Report() const {
  const std::string& problem = reader_->summary_problem();
  if (!problem.empty() || !damage_.empty()) {
    constexpr const char* kAdvice = "'taclink log recover' makes a whole log of it";
    const bool nothing_intact = reader_->statistics().message_count == 0;
    if (nothing_intact || (messages_read_ == 0 && !damage_.empty())) {
      return Wrong(fmt::format("{}: not one of the messages could be read: {}; {}", file_,
                               damage_.empty() ? problem : *damage_.begin(), kAdvice));
    }
    fmt::print(stderr, "taclink: {}: not closed, or damaged; what is intact was used; {}\n", file_, kAdvice);
    if (const auto& scan = reader_->scan(); scan && !problem.empty())
      fmt::print(stderr, "  {}; found instead: {}\n", problem, scan->Text());
    PrintNotes(damage_);
  }
  if (!left_out_.empty()) {
    fmt::print(stderr, "taclink: {}: not all was understood\n", file_);
    PrintNotes(left_out_);
  }
  return {};
}

LogMessages::LogMessages(LogSource& source, const mcap::CursorOptions& options)
    : source_(source),
      cursor_(source.reader(), options),
      start_ns_(std::max(options.start_ns, source.reader().statistics().message_start_ns)),
      end_ns_(std::min(options.end_ns, source.reader().statistics().message_end_ns)) {}

std::optional<mcap::Message> LogMessages::Next() {
  while (true) {
    const auto message = cursor_.Next();
    if (message) {
      source_.NoteRead();
      if (end_ns_ > start_ns_ && message->log_time_ns >= start_ns_)
        share_ =
            static_cast<double>(message->log_time_ns - start_ns_) / static_cast<double>(end_ns_ - start_ns_);
      return *message;
    }
    if (message.error().code == ErrorCode::kEndOfData) return std::nullopt;
    source_.NoteDamage(message.error().message);
  }
}

void AddPartOptions(const Arguments& command, PartOptions& options) {
  constexpr const char* kForm = "seconds from the log's start, or 2026-11-22T12:01:37.250Z";
  command.AddOption("--from", options.from, std::string("Log time of the first message: ") + kForm);
  command.AddOption("--to", options.to, "Log time that all messages are before; as --from");
  command.AddOption("--link", options.links, "Names of links (default: all)");
}

Result<LogPart> ChoosePart(const LogSource& source, const PartOptions& options) {
  LogPart part;
  if (const auto chosen = ChooseRange(source, options, part); !chosen) return chosen.error();
  if (const auto chosen = ChooseLinks(source, options, part); !chosen) return chosen.error();
  return part;
}

Result<uint64_t> ParseLogTime(const std::string& text, uint64_t start_ns) {
  double seconds = 0;
  if (ParseWhole(text, seconds)) {
    if (!(seconds >= 0 && seconds <= kMostSeconds))
      return Wrong("'" + text + "' is not a number of seconds from the log's start");
    const auto offset_ns = static_cast<uint64_t>(std::llround(seconds * 1e9));
    return start_ns > UINT64_MAX - offset_ns ? UINT64_MAX : start_ns + offset_ns;
  }
  if (const auto utc_ns = ParseUtc(text)) return *utc_ns;
  return Wrong("'" + text + "' is no time; give seconds from the log's start, or 2026-11-22T12:01:37.250Z");
}

std::string LinkOf(const mcap::Channel& channel) {
  if (const auto named = channel.metadata.find("link"); named != channel.metadata.end()) return named->second;
  const auto topic = wire::log::ParseTopic(channel.topic);
  return topic ? topic->link : std::string();
}

std::string Joined(const std::set<std::string>& names) {
  return fmt::format("{}", fmt::join(names, ", "));
}

std::set<uint16_t> ChannelsOf(const mcap::Reader& reader, const LogPart& part) {
  std::set<uint16_t> channels;
  for (const auto& [id, channel] : reader.channels()) {
    const std::string link = LinkOf(channel);
    if (link.empty() || part.Has(link)) channels.insert(id);
  }
  return channels;
}

std::string SchemaOf(const mcap::Reader& reader, const mcap::Channel& channel) {
  const auto schema = reader.schemas().find(channel.schema_id);
  return schema == reader.schemas().end() ? std::string() : schema->second.name;
}

}  // namespace taclink::command
