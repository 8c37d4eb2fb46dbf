#pragma once

#include "client/command/commands.h"

namespace taclink::command {

/// Registers `taclink calibrate material` under `calibrate`.
void AddCalibrateMaterial(CLI::App& calibrate, Selected& selected);

}  // namespace taclink::command
