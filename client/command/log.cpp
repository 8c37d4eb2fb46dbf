#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string>

#include "client/command/commands.h"
#include "client/command/json.h"
#include "client/command/log_text.h"
#include "client/command/log_tools.h"
#include "wire/mcap/check.h"
#include "wire/mcap/file_sink.h"
#include "wire/mcap/reader.h"
#include "wire/mcap/recover.h"

namespace taclink::command {
namespace {

struct Options {
  std::string file, output;
  bool json = false;
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

void PrintText(const std::string& file, uint64_t size, const mcap::Reader& reader) {
  const mcap::Statistics& statistics = reader.statistics();
  fmt::print("{}: {}, written by {}\n", file, SizeText(size), reader.header().library);
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
    fmt::print("  {:<32} {:>9}  {}\n", channel.topic, MessagesOf(statistics, id),
               SchemaName(reader, channel));
  }
  for (const auto& attachment : reader.attachments()) {
    fmt::print("attachment {}, {}, {}\n", attachment.name, attachment.media_type,
               SizeText(attachment.data_size));
  }
  for (const auto& metadata : reader.metadata()) {
    const auto record = reader.ReadMetadata(metadata);
    fmt::print("metadata {}\n", metadata.name);
    if (!record) continue;
    for (const auto& [key, value] : record->metadata) fmt::print("  {}: {}\n", key, value);
  }
}

void PrintJson(const std::string& file, uint64_t size, const mcap::Reader& reader) {
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
                         .dump());
}

Result<void> Info(const Options& options) {
  const auto source = OpenBytes(options.file);
  if (!source) return source.error();
  const auto reader = mcap::Reader::Open(*source);
  if (!reader) return In(options.file, reader.error());
  (options.json ? PrintJson : PrintText)(options.file, (*source)->size(), **reader);
  return {};
}

Result<void> CheckLog(const Options& options) {
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

Result<void> Recover(const Options& options) {
  const auto source = OpenBytes(options.file);
  if (!source) return source.error();
  auto sink = mcap::FileSink::Create(options.output);
  if (!sink) return sink.error();
  mcap::RecoverOptions recover;
  recover.writer.compression = mcap::Compression::kZstd;
  const auto report = mcap::Recover(**source, **sink, recover);
  if (!report) return In(options.file, report.error());
  if (const auto synced = (*sink)->Sync(); !synced) return synced.error();
  fmt::print("{}\n", report->scan.Text());
  for (const mcap::LostRange& lost : report->scan.lost)
    fmt::print("  lost: bytes {} to {}: {}\n", lost.offset, lost.offset + lost.length, lost.why);
  fmt::print("{}: {} messages, {} attachments\n", options.output, report->written.message_count,
             report->written.attachment_count);
  return {};
}

Arguments AddOne(const Arguments& log, const std::string& name, const std::string& what,
                 const std::shared_ptr<Options>& options, Selected& selected,
                 Result<void> (*run)(const Options&)) {
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
  auto options = std::make_shared<Options>();
  AddOne(log, "info", "What a log holds", options, selected, Info)
      .AddFlag("--json", options->json, "One JSON object");
  AddOne(log, "check", "Whether a log is whole: every record, index and checksum", options, selected,
         CheckLog);
  AddOne(log, "recover", "Write all that is intact in a damaged or unfinished log to a new one", options,
         selected, Recover)
      .AddOption("-o,--output", options->output, "The new log")
      .Required();
  AddLogCut(log, selected);
  AddLogMerge(log, selected);
  AddLogExport(log, selected);
  AddLogPlot(log, selected);
  AddLogSolve(log, selected);
}

}  // namespace taclink::command
