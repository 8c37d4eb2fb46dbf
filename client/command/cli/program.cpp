#include "client/command/cli/program.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "client/command/cli/nearest.h"
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

std::vector<std::string> CommandsOf(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  return names;
}

std::string Meant(const std::string& typed, const std::vector<std::string>& names) {
  const std::string nearest = Nearest(typed, names);
  return nearest.empty() ? std::string() : "; did you mean '" + nearest + "'?";
}

// A word a line that may follow these words of a command line: for the shells' completion.
int Complete(const CLI::App& app, const std::vector<std::string>& words) {
  const CLI::App* command = &app;
  for (const std::string& word : words)
    for (const CLI::App* next : command->get_subcommands([](const CLI::App*) { return true; }))
      if (next->get_name() == word) command = next;
  for (const std::string& name : CommandsOf(*command)) std::printf("%s\n", name.c_str());
  for (const CLI::Option* option : command->get_options())
    for (const std::string& name : option->get_lnames()) std::printf("--%s\n", name.c_str());
  return 0;
}

// CLI11 ends its message about an option that there is not with that option.
std::string MeantOption(const CLI::App& app, const std::string& message) {
  const size_t begin = message.rfind(" --");
  if (message.find("not expected") == std::string::npos || begin == std::string::npos) return {};
  const CLI::App* command = &app;
  while (!command->get_subcommands().empty()) command = command->get_subcommands().front();
  std::vector<std::string> names;
  for (const CLI::Option* option : command->get_options())
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  return Meant(message.substr(begin + 1), names);
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
  if (argc > 1 && argv[1] == std::string("__complete")) return Complete(app, {argv + 2, argv + argc});
  const std::string help = "; see " + program.name + " --help";
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);
    // CLI11 only says that a subcommand is missing.
    const bool unknown = argc > 1 && argv[1][0] != '-' && app.get_subcommands().empty();
    if (unknown)
      return Complain(program.name,
                      "no command '" + std::string(argv[1]) + "'" + Meant(argv[1], CommandsOf(app)) + help,
                      kUsage);
    return Complain(program.name, e.what() + MeantOption(app, e.what()) + help, kUsage);
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
