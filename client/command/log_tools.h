#pragma once

#include "client/command/commands.h"

namespace taclink::command {

/// Each registers one subcommand of `taclink log`.
void AddLogCut(CLI::App& log, Selected& selected);
void AddLogMerge(CLI::App& log, Selected& selected);
void AddLogExport(CLI::App& log, Selected& selected);
void AddLogPlot(CLI::App& log, Selected& selected);
void AddLogSolve(CLI::App& log, Selected& selected);

/// Of the log that is written; `compression` stays empty: as the source's.
inline void AddCompressionOption(CLI::App& command, std::string& compression) {
  command.add_option("--compression", compression, "none, zstd or lz4 (default: as the source's)")
      ->check(CLI::IsMember({"none", "zstd", "lz4"}));
}

}  // namespace taclink::command
