#pragma once

#include "client/command/commands.h"

namespace taclink::command {

/// `taclink bench server`.
void AddBenchServer(CLI::App& bench, Selected& selected);

}  // namespace taclink::command
