#include "client/command/cli/program.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>

#include "sensing/core/file_modes.h"
#include "sensing/core/printable.h"

namespace taclink::command {
namespace {

constexpr int kFailed = 1;
constexpr int kUsage = 2;

int Complain(const std::string& program, std::string message, int code) {
  std::replace(message.begin(), message.end(), '\n', ' ');
  std::fprintf(stderr, "%s: %s\n", program.c_str(), Printable(message).c_str());
  return code;
}

}  // namespace

int Run(const Program& program, int argc, char** argv) {
  KeepFilesFromOthers();
  CLI::App app(program.description, program.name);
  app.set_version_flag("--version", std::string(TACLINK_VERSION));
  app.require_subcommand(1);
  Selected selected;
  program.add_commands(Arguments(app), selected);
  app.footer(program.footer);  // last: commands that are added later inherit it
  const std::string help = "; see " + program.name + " --help";
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);
    // CLI11 only says that a subcommand is missing.
    const bool unknown = argc > 1 && argv[1][0] != '-' && app.get_subcommands().empty();
    return Complain(
        program.name,
        unknown ? "no command '" + std::string(argv[1]) + "'" + help : std::string(e.what()) + help, kUsage);
  }
  try {
    const auto result = selected();
    if (!result) return Complain(program.name, result.error().message, kFailed);
    const bool written = std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
    return written ? 0
                   : Complain(program.name, "the output could not be written; check the disk or the pipe",
                              kFailed);
  } catch (const std::exception& e) {
    return Complain(program.name, std::string("failed unexpectedly: ") + e.what(), kFailed);
  }
}

}  // namespace taclink::command
