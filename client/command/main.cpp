#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>

#include "client/command/commands.h"
#include "sensing/core/file_modes.h"
#include "sensing/core/printable.h"

namespace {

constexpr int kFailed = 1;
constexpr int kUsage = 2;
constexpr const char* kEnvironment =
    "Environment: TACLINK_PATIENCE_S is the least number of seconds that a server gets to answer, for\n"
    "slow machines. Without it: 3 to connect, 5 between messages of a stream, 10 or more for a call.";

int Complain(std::string message, int code) {
  std::replace(message.begin(), message.end(), '\n', ' ');
  std::fprintf(stderr, "taclink: %s\n", taclink::Printable(message).c_str());
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  taclink::KeepFilesFromOthers();
  CLI::App app("Looks at soft tactile links: live from a server, or offline from files", "taclink");
  app.set_version_flag("--version", std::string(TACLINK_VERSION));
  app.require_subcommand(1);
  const taclink::command::Arguments arguments(app);
  taclink::command::Selected selected;
  taclink::command::AddCameras(arguments, selected);
  taclink::command::AddList(arguments, selected);
  taclink::command::AddLog(arguments, selected);
  taclink::command::AddRecord(arguments, selected);
  taclink::command::AddRestart(arguments, selected);
  taclink::command::AddWatch(arguments, selected);
  taclink::command::AddDetect(arguments, selected);
  taclink::command::AddSolve(arguments, selected);
  taclink::command::AddCalibrate(arguments, selected);
  taclink::command::AddSimulate(arguments, selected);
  taclink::command::AddSkin(arguments, selected);
  taclink::command::AddBench(arguments, selected);
  taclink::command::AddContacts(arguments, selected);
  taclink::command::AddJoints(arguments, selected);
  taclink::command::AddShow(arguments, selected);
  taclink::command::AddToken(arguments, selected);
  taclink::command::AddTare(arguments, selected);
  taclink::command::AddEvents(arguments, selected);
  taclink::command::AddThresholds(arguments, selected);
  taclink::command::AddSet(arguments, selected);
  app.footer(kEnvironment);  // last: commands that are added later inherit it
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);
    // CLI11 only says that a subcommand is missing.
    const bool unknown = argc > 1 && argv[1][0] != '-' && app.get_subcommands().empty();
    return Complain(unknown ? "no command '" + std::string(argv[1]) + "'; see taclink --help"
                            : std::string(e.what()) + "; see taclink --help",
                    kUsage);
  }
  try {
    const auto result = selected();
    if (!result) return Complain(result.error().message, kFailed);
    const bool written = std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
    return written ? 0 : Complain("the output could not be written; check the disk or the pipe", kFailed);
  } catch (const std::exception& e) {
    return Complain(std::string("failed unexpectedly: ") + e.what(), kFailed);
  }
}
