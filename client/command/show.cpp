#include <cstdio>
#include <memory>
#include <string>

#include "client/command/commands.h"
#include "sensing/model/model_file.h"
#include "sensing/simulation/scene.h"

namespace taclink::command {
namespace {

Result<void> Print(std::string_view text, const std::string& kind, const std::string& name,
                   const std::vector<std::string>& names) {
  if (!text.empty()) {
    std::fwrite(text.data(), 1, text.size(), stdout);
    return {};
  }
  std::string known;
  for (const auto& one : names) known += (known.empty() ? "" : ", ") + one;
  return Error{ErrorCode::kNotFound, "no shipped " + kind + " '" + name + "'; there are: " + known};
}

}  // namespace

void AddShow(CLI::App& app, Selected& selected) {
  auto name = std::make_shared<std::string>();
  CLI::App* show = app.add_subcommand("show", "Print a shipped file, to copy and change");
  show->require_subcommand(1);
  CLI::App* model = show->add_subcommand("model", "A link model");
  model->add_option("name", *name, "Its name")->required();
  model->callback([name, &selected] {
    selected = [name] { return Print(ShippedModelText(*name), "model", *name, ShippedModelNames()); };
  });
  CLI::App* scene = show->add_subcommand("scene", "A scene of the simulation");
  scene->add_option("name", *name, "Its name")->required();
  scene->callback([name, &selected] {
    selected = [name] { return Print(ShippedSceneText(*name), "scene", *name, ShippedSceneNames()); };
  });
}

}  // namespace taclink::command
