#pragma once

#include "client/command/commands.h"

namespace taclink::command {

/// `taclink bench accuracy`.
void AddBenchAccuracy(const Arguments& bench, Selected& selected);
/// `taclink bench stability`.
void AddBenchStability(const Arguments& bench, Selected& selected);
/// `taclink bench whole`.
void AddBenchWhole(const Arguments& bench, Selected& selected);

}  // namespace taclink::command
