#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "client/command/cli/commands.h"
#include "client/command/cli/interrupt.h"
#include "client/command/cli/json.h"
#include "client/command/cli/log_text.h"
#include "client/command/cli/progress.h"
#include "client/command/live/connect.h"
#include "client/command/live/download_target.h"
#include "client/cpp/taclink/recordings.h"
#include "sensing/core/printable.h"

namespace taclink::command {
namespace {

using client::Recordings;

struct RecordOptions {
  std::string server = "127.0.0.1:50051";
  std::string name, note;
  std::vector<std::string> links;
  bool pictures = false;
  std::string compression = "configured";
  std::string log, output;
  double duration_s = 0;
  bool json = false;
};

Result<Recordings> Connect(const RecordOptions& options) {
  auto connection = ConnectTo(options.server);
  if (!connection) return connection.error();
  return connection->RecordingCalls();
}

Json RecorderJson(const v1::RecorderStatus& status) {
  return {{"state", client::Name(status.state())},
          {"trouble", status.trouble()},
          {"last_trouble", status.last_trouble()},
          {"last_trouble_utc_ns", status.last_trouble_utc_ns()},
          {"log", status.log()},
          {"folder", status.folder()},
          {"started_utc_ns", status.started_utc_ns()},
          {"synced_utc_ns", status.synced_utc_ns()},
          {"bytes", status.bytes()},
          {"logs", status.logs()},
          {"frames", status.frames()},
          {"events", status.events()},
          {"frames_lost", status.frames_lost()},
          {"free_bytes", status.free_bytes()},
          {"pictures", status.pictures()}};
}

void Print(const v1::RecorderStatus& status, bool json) {
  if (json) {
    fmt::print("{}\n", RecorderJson(status).dump());
    return;
  }
  fmt::print("{}{}{}\n", client::Name(status.state()), status.log().empty() ? "" : ": ", status.log());
  if (!status.trouble().empty()) fmt::print("  {}\n", status.trouble());
  if (status.last_trouble() != status.trouble() && !status.last_trouble().empty())
    fmt::print("  before, at {}: {}\n", UtcText(status.last_trouble_utc_ns()), status.last_trouble());
  if (status.started_utc_ns() != 0) {
    fmt::print("  {} frames, {} lost, {} events, {} in {} logs\n", status.frames(), status.frames_lost(),
               status.events(), SizeText(status.bytes()), status.logs());
  }
  if (status.folder().empty()) {
    fmt::print("  no folder is configured (recording.folder): nothing can be recorded\n");
  } else {
    fmt::print("  folder {} on the server, {} free\n", status.folder(), SizeText(status.free_bytes()));
  }
}

Result<void> PrintStatus(const Result<v1::RecorderStatus>& status, const RecordOptions& options) {
  if (!status) return status.error();
  Print(*status, options.json);
  return {};
}

void WaitFor(double duration_s) {
  CatchInterrupts();
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(duration_s);
  while (!IsInterrupted() && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
}

Result<void> Start(const RecordOptions& options) {
  auto recordings = Connect(options);
  if (!recordings) return recordings.error();
  v1::StartRecordingRequest request;
  request.set_name(options.name);
  request.mutable_links()->Assign(options.links.begin(), options.links.end());
  request.set_pictures(options.pictures);
  request.set_compression(
      client::ValueOf<v1::LogCompression>(options.compression).value_or(v1::LOG_COMPRESSION_UNSPECIFIED));
  request.set_note(options.note);
  const auto started = recordings->Start(request);
  if (!started || options.duration_s <= 0) return PrintStatus(started, options);
  WaitFor(options.duration_s);
  return PrintStatus(recordings->Stop(), options);
}

Result<void> Stop(const RecordOptions& options) {
  auto recordings = Connect(options);
  if (!recordings) return recordings.error();
  return PrintStatus(recordings->Stop(), options);
}

Result<void> Status(const RecordOptions& options) {
  auto recordings = Connect(options);
  if (!recordings) return recordings.error();
  return PrintStatus(recordings->Status(), options);
}

Json LogJson(const v1::Log& log) {
  return {{"name", log.name()},
          {"bytes", log.bytes()},
          {"start_utc_ns", log.start_utc_ns()},
          {"end_utc_ns", log.end_utc_ns()},
          {"links", std::vector<std::string>(log.links().begin(), log.links().end())},
          {"frames", log.frames()},
          {"contacts", log.has_contacts() ? Json(log.contacts()) : Json()},
          {"pictures", log.pictures()},
          {"open", log.open()},
          {"problem", log.problem()},
          {"note", log.note()}};
}

void PrintRow(const v1::Log& log) {
  fmt::print("{:<44} {:>9}", log.name(), SizeText(log.bytes()));
  if (log.open()) {
    fmt::print("  being written");
  } else if (log.start_utc_ns() != 0) {
    fmt::print("  {}  {:>8.1f} s  {} links, {} frames", UtcText(static_cast<uint64_t>(log.start_utc_ns())),
               static_cast<double>(log.end_utc_ns() - log.start_utc_ns()) * 1e-9, log.links_size(),
               log.frames());
    if (log.has_contacts()) fmt::print(", {} contacts", log.contacts());
    if (log.pictures()) fmt::print(", pictures");
  }
  fmt::print("{}{}\n", log.note().empty() ? "" : "  ", Printable(log.note()));
  if (!log.problem().empty()) fmt::print("  {}\n", Printable(log.problem()));
}

Result<void> List(const RecordOptions& options) {
  auto recordings = Connect(options);
  if (!recordings) return recordings.error();
  const auto logs = recordings->List();
  if (!logs) return logs.error();
  if (!options.json && logs->logs().empty()) fmt::print("no logs\n");
  for (const v1::Log& log : logs->logs()) {
    if (options.json) {
      fmt::print("{}\n", LogJson(log).dump());
    } else {
      PrintRow(log);
    }
  }
  return {};
}

std::string FetchPath(const RecordOptions& options) {
  const std::string path = options.output.empty() ? options.log : options.output;
  return path != "-" && std::filesystem::is_directory(path) ? path + "/" + options.log : path;
}

Error FetchError(Error error, const DownloadTarget& target) {
  if (error.code == ErrorCode::kUnavailable && target.can_resume())
    error.message += "; the same command again fetches the rest";
  return error;
}

// What a file has of the log stays, and the rest is fetched.
Result<void> Download(const RecordOptions& options) {
  auto recordings = Connect(options);
  if (!recordings) return recordings.error();
  auto target = DownloadTarget::Open(FetchPath(options));
  if (!target) return target.error();
  const uint64_t there = target->there(), start = target->start();
  Result<void> written;
  const auto done = [&] {
    Progress progress(options.log);
    return recordings->Download(
        options.log, start, [&](std::string_view data, uint64_t offset, uint64_t size) {
          progress.Show(static_cast<double>(offset - start) / static_cast<double>(size - start));
          written = target->Receive(data, offset);
          return written.ok();
        });
  }();
  if (!written) return written;
  if (!done) {
    target->RemoveIfNew();
    return FetchError(done.error(), *target);
  }
  if (const auto closed = target->Close(); !closed) return closed;
  fmt::print(target->is_stdout() ? stderr : stdout, "{}: {}{}\n", target->name(), SizeText(target->size()),
             there > 0 ? ", of which " + SizeText(there) + " were there" : "");
  return {};
}

Result<void> Delete(const RecordOptions& options) {
  auto recordings = Connect(options);
  if (!recordings) return recordings.error();
  return recordings->Delete(options.log);
}

Arguments AddOne(const Arguments& record, const char* name, const char* what,
                 const std::shared_ptr<RecordOptions>& options, Selected& selected,
                 Result<void> (*run)(const RecordOptions&)) {
  const Arguments command = record.AddCommand(name, what);
  AddServerOption(command, options->server);
  command.OnChosen([options, run, &selected] { selected = [options, run] { return run(*options); }; });
  return command;
}

}  // namespace

void AddRecord(const Arguments& app, Selected& selected) {
  const Arguments record = app.AddCommand("record", "Record what a server's links feel, on the server");
  record.RequireCommand();
  auto options = std::make_shared<RecordOptions>();
  const Arguments start = AddOne(record, "start", "Begin a recording", options, selected, Start);
  start.AddOption("--name", options->name, "Part of the logs' names (default: the arm's name)");
  start.AddOption("--link", options->links, "Names of links (default: all)");
  start.AddFlag("--pictures", options->pictures, "Also the cameras' pictures, as they sent them");
  start.AddOption("--compression", options->compression, "Of the logs")
      .Must(OneOf(client::Names<v1::LogCompression>(), "configured"));
  start.AddOption("--note", options->note, "Text kept in the logs");
  start
      .AddOption("--duration", options->duration_s,
                 "Stop after so many seconds, or with ^C; 0: later, by 'stop'")
      .Must(Within(0, 1e9));
  const Arguments stop = AddOne(record, "stop", "End it", options, selected, Stop);
  const Arguments status =
      AddOne(record, "status", "How the server's recorder does", options, selected, Status);
  const Arguments list = AddOne(record, "list", "The server's logs", options, selected, List);
  for (const Arguments& command : {start, stop, status, list})
    command.AddFlag("--json", options->json, "JSON");
  const Arguments fetch = AddOne(record, "fetch", "Copy a log from the server; goes on where it broke off",
                                 options, selected, Download);
  fetch.AddOption("-o,--output", options->output,
                  "File, folder or pipe; - is standard output (default: its name, here)");
  const Arguments remove = AddOne(record, "delete", "Delete a log on the server", options, selected, Delete);
  for (const Arguments& command : {fetch, remove})
    command.AddOption("log", options->log, "Name of the log, as 'list' shows it").Required();
  AddPlay(record, selected);
}

}  // namespace taclink::command
