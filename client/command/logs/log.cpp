#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>

#include "client/command/cli/commands.h"
#include "client/command/cli/json.h"
#include "client/command/cli/log_text.h"
#include "client/command/logs/log_tools.h"
#include "mcap/check.h"
#include "mcap/file_sink.h"
#include "mcap/reader.h"
#include "mcap/recover.h"
#include "sensing/core/printable.h"

namespace taclink::command {
namespace {

struct LogOptions {
  std::string file, output;
  bool json = false, unverified = false;
};

Error In(const std::string& file, Error error) {
  error.message = file + ": " + error.message;
  return error;
}

Result<std::shared_ptr<mcap::ByteSource>> OpenBytes(const std::string& file) {
  auto source = mcap::FileSource::Open(file);
  if (!source) return source.error();
  return std::shared_ptr<mcap::ByteSource>(std::move(*source));
}

uint64_t MessagesOf(const mcap::Statistics& statistics, uint16_t channel) {
  const auto at = statistics.channel_message_counts.find(channel);
  return at == statistics.channel_message_counts.end() ? 0 : at->second;
}

std::string SchemaName(const mcap::Reader& reader, const mcap::Channel& channel) {
  const auto at = reader.schemas().find(channel.schema_id);
  return at == reader.schemas().end() ? "no schema" : at->second.name;
}

void PrintLogText(const std::string& file, uint64_t size, const mcap::Reader& reader) {
  const mcap::Statistics& statistics = reader.statistics();
  fmt::print("{}: {}, written by {}\n", file, SizeText(size), Printable(reader.header().library));
  if (!reader.summary_problem().empty())
    fmt::print("not closed, or damaged: {}; 'taclink log recover' makes it whole\n",
               reader.summary_problem());
  if (statistics.message_count > 0) {
    fmt::print("{} to {}, {:.3f} s\n", UtcText(statistics.message_start_ns),
               UtcText(statistics.message_end_ns),
               static_cast<double>(statistics.message_end_ns - statistics.message_start_ns) * 1e-9);
  }
  fmt::print("{} messages in {} chunks\n", statistics.message_count, statistics.chunk_count);
  for (const auto& [id, channel] : reader.channels()) {
    fmt::print("  {:<32} {:>9}  {}\n", Printable(channel.topic), MessagesOf(statistics, id),
               Printable(SchemaName(reader, channel)));
  }
  for (const auto& attachment : reader.attachments()) {
    fmt::print("attachment {}, {}, {}\n", Printable(attachment.name), Printable(attachment.media_type),
               SizeText(attachment.data_size));
  }
  for (const auto& metadata : reader.metadata()) {
    const auto record = reader.ReadMetadata(metadata);
    fmt::print("metadata {}\n", Printable(metadata.name));
    if (!record) continue;
    for (const auto& [key, value] : record->metadata)
      fmt::print("  {}: {}\n", Printable(key), Printable(value));
  }
}

void PrintLogJson(const std::string& file, uint64_t size, const mcap::Reader& reader) {
  const mcap::Statistics& statistics = reader.statistics();
  Json channels = Json::array(), attachments = Json::array(), metadata = Json::object();
  for (const auto& [id, channel] : reader.channels()) {
    channels.push_back({{"topic", channel.topic},
                        {"schema", SchemaName(reader, channel)},
                        {"messages", MessagesOf(statistics, id)},
                        {"metadata", channel.metadata}});
  }
  for (const auto& one : reader.attachments()) {
    attachments.push_back({{"name", one.name}, {"media_type", one.media_type}, {"bytes", one.data_size}});
  }
  for (const auto& index : reader.metadata()) {
    if (const auto record = reader.ReadMetadata(index)) metadata[index.name] = record->metadata;
  }
  fmt::print("{}\n", Json({{"file", file},
                           {"bytes", size},
                           {"library", reader.header().library},
                           {"problem", reader.summary_problem()},
                           {"messages", statistics.message_count},
                           {"chunks", statistics.chunk_count},
                           {"start_utc_ns", statistics.message_start_ns},
                           {"end_utc_ns", statistics.message_end_ns},
                           {"channels", std::move(channels)},
                           {"attachments", std::move(attachments)},
                           {"metadata", std::move(metadata)}})
                         .dump(-1, ' ', true, Json::error_handler_t::replace));
}

Result<void> Info(const LogOptions& options) {
  const auto source = OpenBytes(options.file);
  if (!source) return source.error();
  const auto reader = mcap::Reader::Open(*source);
  if (!reader) return In(options.file, reader.error());
  (options.json ? PrintLogJson : PrintLogText)(options.file, (*source)->size(), **reader);
  return {};
}

Result<void> CheckLog(const LogOptions& options) {
  const auto source = OpenBytes(options.file);
  if (!source) return source.error();
  const auto report = mcap::Check(**source);
  if (!report) return In(options.file, report.error());
  for (const mcap::Finding& finding : report->findings) {
    fmt::print("{}: at byte {}: {}\n", finding.severity == mcap::Severity::kError ? "error" : "warning",
               finding.offset, finding.what);
  }
  if (report->ok()) {
    fmt::print("{}: good{}\n", options.file,
               report->warnings > 0 ? fmt::format(", {} warnings", report->warnings) : "");
    return {};
  }
  return Error{
      ErrorCode::kInvalidArgument,
      fmt::format("{}: {} errors; 'taclink log recover' saves what is intact", options.file, report->errors)};
}

Result<void> Recover(const LogOptions& options) {
  const auto source = OpenBytes(options.file);
  if (!source) return source.error();
  auto sink = mcap::FileSink::Create(options.output);
  if (!sink) return sink.error();
  mcap::RecoverOptions recover;
  recover.writer.compression = mcap::Compression::kZstd;
  recover.scan.keep_unverified = options.unverified;
  const auto report = mcap::Recover(**source, **sink, recover);
  if (!report) return In(options.file, report.error());
  const mcap::ScanReport& scan = report->scan;
  const mcap::Statistics& written = report->written;
  if (const auto synced = (*sink)->Sync(); !synced) return synced.error();
  fmt::print("{}\n", scan.Text());
  for (const mcap::LostRange& lost : scan.lost)
    fmt::print("  lost: bytes {} to {}: {}\n", lost.offset, lost.offset + lost.length, lost.why);
  const auto size = static_cast<double>((*source)->size());
  const double share = size > 0 ? 1 - static_cast<double>(scan.lost_bytes) / size : 0;
  fmt::print("{}: {} messages, {} attachments; {:.1f} % of the bytes were intact\n", options.output,
             written.message_count, written.attachment_count, 100 * share);
  if (written.message_count > 0 || (scan.clean() && size > 0)) return {};
  if (written.attachment_count + written.metadata_count == 0) {
    std::error_code ignored;
    std::filesystem::remove(options.output, ignored);
  }
  return Error{ErrorCode::kInvalidArgument,
               options.file + ": no message in it is intact" +
                   (scan.dropped > 0 ? "; --unverified keeps those whose checksum is wrong" : "")};
}

Arguments AddOne(const Arguments& log, const std::string& name, const std::string& what,
                 const std::shared_ptr<LogOptions>& options, Selected& selected,
                 Result<void> (*run)(const LogOptions&)) {
  const Arguments command = log.AddCommand(name, what);
  command.AddOption("file", options->file, "The log, MCAP").Required();
  command.OnChosen([options, run, &selected] { selected = [options, run] { return run(*options); }; });
  return command;
}

}  // namespace

void AddLog(const Arguments& app, Selected& selected) {
  const Arguments log =
      app.AddCommand("log", "Look into logs, check, mend, cut, merge, export and draw them");
  log.RequireCommand();
  auto options = std::make_shared<LogOptions>();
  AddOne(log, "info", "What a log holds", options, selected, Info)
      .AddFlag("--json", options->json, "One JSON object");
  AddOne(log, "check", "Whether a log is whole: every record, index and checksum", options, selected,
         CheckLog);
  const Arguments recover =
      AddOne(log, "recover", "Write all that is intact in a damaged or unfinished log to a new one", options,
             selected, Recover);
  recover.AddOption("-o,--output", options->output, "The new log").Required();
  recover.AddFlag("--unverified", options->unverified,
                  "Also messages whose checksum is wrong or lost: what they say may be wrong, too");
  AddLogCut(log, selected);
  AddLogMerge(log, selected);
  AddLogExport(log, selected);
  AddLogPlot(log, selected);
  AddLogSolve(log, selected);
}

}  // namespace taclink::command
