#pragma once

#include "client/command/cli/commands.h"

namespace taclink::command {

/// Each registers one subcommand of `taclink log`.
void AddLogCut(const Arguments& log, Selected& selected);
void AddLogMerge(const Arguments& log, Selected& selected);
void AddLogExport(const Arguments& log, Selected& selected);
void AddLogPlot(const Arguments& log, Selected& selected);
void AddLogSolve(const Arguments& log, Selected& selected);

/// Of the log that is written; `compression` stays empty: as the source's.
inline void AddCompressionOption(const Arguments& command, std::string& compression) {
  command.AddOption("--compression", compression, "none, zstd or lz4 (default: as the source's)")
      .Must(OneOf({"none", "zstd", "lz4"}));
}

}  // namespace taclink::command
