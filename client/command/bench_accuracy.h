#pragma once

#include "client/command/commands.h"

namespace taclink::command {

/// `taclink bench accuracy`.
void AddBenchAccuracy(CLI::App& bench, Selected& selected);
/// `taclink bench stability`.
void AddBenchStability(CLI::App& bench, Selected& selected);

}  // namespace taclink::command
