#include <cstdio>
#include <memory>
#include <string>

#include "client/command/cli/commands.h"
#include "sensing/acceptance/acceptance_plan.h"
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

void AddShow(const Arguments& app, Selected& selected) {
  auto name = std::make_shared<std::string>();
  const Arguments show = app.AddCommand("show", "Print a shipped file, to copy and change");
  show.RequireCommand();
  const Arguments model = show.AddCommand("model", "A link model");
  model.AddOption("name", *name, "Its name").Required();
  model.OnChosen([name, &selected] {
    selected = [name] { return Print(ShippedModelText(*name), "model", *name, ShippedModelNames()); };
  });
  const Arguments scene = show.AddCommand("scene", "A scene of the simulation");
  scene.AddOption("name", *name, "Its name").Required();
  scene.OnChosen([name, &selected] {
    selected = [name] { return Print(ShippedSceneText(*name), "scene", *name, ShippedSceneNames()); };
  });
  const Arguments plan = show.AddCommand("plan", "A plan of taclink accept");
  plan.AddOption("name", *name, "Its name").Required();
  plan.OnChosen([name, &selected] {
    selected = [name] { return Print(ShippedPlanText(*name), "plan", *name, ShippedPlanNames()); };
  });
}

}  // namespace taclink::command
