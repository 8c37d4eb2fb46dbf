#pragma once

#include "client/command/cli/commands.h"

namespace taclink::command {

/// Subcommands of `taclink skin`.
void AddSkinCheck(const Arguments& skin, Selected& selected);
void AddSkinStiffness(const Arguments& skin, Selected& selected);

}  // namespace taclink::command
