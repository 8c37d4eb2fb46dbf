#pragma once

#include "client/command/commands.h"

namespace taclink::command {

/// `taclink bench log`.
void AddBenchLog(const Arguments& bench, Selected& selected);

}  // namespace taclink::command
