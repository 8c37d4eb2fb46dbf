#pragma once

#include "client/command/cli/commands.h"

namespace taclink::command {

// Each registers one subcommand of taclink-bench with its options.
void AddBenchAcceptance(const Arguments& bench, Selected& selected);
void AddBenchAccuracy(const Arguments& bench, Selected& selected);
void AddBenchLog(const Arguments& bench, Selected& selected);
void AddBenchServer(const Arguments& bench, Selected& selected);
void AddBenchStability(const Arguments& bench, Selected& selected);
void AddBenchSweep(const Arguments& bench, Selected& selected);
void AddBenchVision(const Arguments& bench, Selected& selected);
void AddBenchWhole(const Arguments& bench, Selected& selected);

}  // namespace taclink::command
