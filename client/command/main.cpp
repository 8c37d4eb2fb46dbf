#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>

#include "client/command/commands.h"

namespace {

constexpr int kFailed = 1;
constexpr int kUsage = 2;

int Complain(std::string message, int code) {
  std::replace(message.begin(), message.end(), '\n', ' ');
  std::fprintf(stderr, "taclink: %s\n", message.c_str());
  return code;
}

}  // namespace

namespace taclink::command {

CLI::Validator Within(double min, double max) {
  return {[=](std::string& text) -> std::string {
            double value = 0;
            if (CLI::detail::lexical_cast(text, value) && value >= min && value <= max) return {};
            return "'" + text + "' is not a number from " + std::to_string(min) + " to " +
                   std::to_string(max);
          },
          "NUMBER"};
}

}  // namespace taclink::command

int main(int argc, char** argv) {
  CLI::App app("Looks at soft tactile links: live from a server, or offline from files", "taclink");
  app.set_version_flag("--version", std::string(TACLINK_VERSION));
  app.require_subcommand(1);
  taclink::command::Selected selected;
  taclink::command::AddCameras(app, selected);
  taclink::command::AddList(app, selected);
  taclink::command::AddLog(app, selected);
  taclink::command::AddRecord(app, selected);
  taclink::command::AddRestart(app, selected);
  taclink::command::AddWatch(app, selected);
  taclink::command::AddDetect(app, selected);
  taclink::command::AddSolve(app, selected);
  taclink::command::AddCalibrate(app, selected);
  taclink::command::AddSimulate(app, selected);
  taclink::command::AddSkin(app, selected);
  taclink::command::AddBench(app, selected);
  taclink::command::AddContacts(app, selected);
  taclink::command::AddJoints(app, selected);
  taclink::command::AddShow(app, selected);
  taclink::command::AddToken(app, selected);
  taclink::command::AddTare(app, selected);
  taclink::command::AddEvents(app, selected);
  taclink::command::AddThresholds(app, selected);
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
