#include <fmt/format.h>

#include <memory>
#include <string>

#include "client/command/cli/commands.h"

namespace taclink::command {
namespace {

// The commands and their options, asked of the program itself, so that a script does not age.
constexpr const char* kBash = R"sh(_taclink() {
  local words
  words=$(taclink __complete "${COMP_WORDS[@]:1:COMP_CWORD-1}" 2>/dev/null)
  COMPREPLY=($(compgen -W "$words" -- "${COMP_WORDS[COMP_CWORD]}"))
  [ ${#COMPREPLY[@]} -gt 0 ] || COMPREPLY=($(compgen -f -- "${COMP_WORDS[COMP_CWORD]}"))
}
complete -F _taclink taclink
)sh";
constexpr const char* kZsh = R"sh(#compdef taclink
_taclink() {
  local -a candidates
  candidates=(${(f)"$(taclink __complete "${words[@]:1:$((CURRENT-2))}" 2>/dev/null)"})
  compadd -a candidates || _files
}
compdef _taclink taclink
)sh";
constexpr const char* kFish =
    R"sh(complete -c taclink -a '(taclink __complete (commandline -opc)[2..] 2>/dev/null)'
)sh";

Result<void> PrintScript(const std::string& shell) {
  fmt::print("{}", shell == "bash" ? kBash : shell == "zsh" ? kZsh : kFish);
  return {};
}

}  // namespace

void AddCompletion(const Arguments& app, Selected& selected) {
  auto shell = std::make_shared<std::string>();
  const Arguments command = app.AddCommand(
      "completion", "Print a script that completes commands and options: source <(taclink completion bash)");
  command.AddOption("shell", *shell, "bash, zsh or fish").Must(OneOf({"bash", "zsh", "fish"})).Required();
  command.OnChosen([shell, &selected] { selected = [shell] { return PrintScript(*shell); }; });
}

}  // namespace taclink::command
