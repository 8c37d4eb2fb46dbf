#pragma once

#include "client/command/cli/commands.h"

namespace taclink::command {

/// Registers `taclink calibrate material` under `calibrate`.
void AddCalibrateMaterial(const Arguments& calibrate, Selected& selected);

}  // namespace taclink::command
