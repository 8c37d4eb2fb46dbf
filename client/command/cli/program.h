#pragma once

#include <string>

#include "client/command/cli/commands.h"

namespace taclink::command {

struct Program {
  std::string name;
  std::string description;
  std::string footer = {};  ///< of every --help
  void (*add_commands)(const Arguments& app, Selected& selected);
};

/// The whole of main: parses, runs the chosen command and prints its error. Returns the exit status: 0, 1 (it
/// failed) or 2 (it was called in a wrong way).
int Run(const Program& program, int argc, char** argv);

}  // namespace taclink::command
