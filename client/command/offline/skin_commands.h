#pragma once

#include "client/command/cli/commands.h"

namespace taclink::command {

/// Subcommands of `taclink skin`.
void AddSkinStiffness(const Arguments& skin, Selected& selected);

}  // namespace taclink::command
