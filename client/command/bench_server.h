#pragma once

#include "client/command/commands.h"

namespace taclink::command {

/// `taclink bench server`.
void AddBenchServer(const Arguments& bench, Selected& selected);

}  // namespace taclink::command
