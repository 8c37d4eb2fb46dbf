#include "client/command/logs/log_export.h"

#include <filesystem>
#include <memory>
#include <string>

#include "client/command/logs/log_tools.h"

namespace taclink::command {
namespace {

struct LogExportOptions {
  std::string input, folder, format;
  PartOptions part;
  bool with_pictures = false;
};

Result<void> MakeFolder(const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!error && std::filesystem::is_directory(folder)) return {};
  return Error{ErrorCode::kUnavailable,
               folder + ": can't be made a folder: " + (error ? error.message() : "something else is there") +
                   "; choose another one"};
}

Result<void> Export(const LogExportOptions& options) {
  auto source = LogSource::Open(options.input);
  if (!source) return source.error();
  const auto part = ChoosePart(**source, options.part);
  if (!part) return part.error();
  if (const auto made = MakeFolder(options.folder); !made) return made;
  Result<void> done;
  if (options.format == "csv") done = ExportCsv(**source, *part, options.folder);
  if (options.format == "jsonl") done = ExportJsonl(**source, *part, options.folder, options.with_pictures);
  if (options.format == "npz") done = ExportNpz(**source, *part, options.folder);
  return done ? (*source)->Report() : done;
}

}  // namespace

void AddLogExport(const Arguments& log, Selected& selected) {
  auto options = std::make_shared<LogExportOptions>();
  const Arguments command = log.AddCommand("export", "Write a log's content for other programs; SI units");
  command.AddOption("file", options->input, "The log, MCAP").Required();
  command.AddOption("-o,--output", options->folder, "Folder for the new files").Required();
  command
      .AddOption("--format", options->format,
                 "csv: tables of contacts, frames, events and joints; jsonl: every message; npz: arrays of "
                 "each link")
      .Required()
      .Must(OneOf({"csv", "jsonl", "npz"}));
  AddPartOptions(command, options->part);
  command.AddFlag("--with-pictures", options->with_pictures, "jsonl: also the pictures' bytes, in base64");
  command.OnChosen([options, &selected] { selected = [options] { return Export(*options); }; });
}

}  // namespace taclink::command
