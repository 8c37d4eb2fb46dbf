#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "client/command/cli/commands.h"
#include "client/command/cli/json.h"
#include "client/command/offline/gravity.h"
#include "client/command/offline/skin_commands.h"
#include "sensing/model/model_file.h"
#include "sensing/shell/skin_push.h"

namespace taclink::command {
namespace {

struct PushOptions {
  std::string model;
  std::vector<int> node;
  double depth_mm = 0;
  double pressure_kpa = 0;
  std::string gravity;
  double patch_diameter_mm = 5.5;
  int refinement = 3;
  std::string force_model = "nonlinear";
  bool json = false;
};

Result<void> Push(const PushOptions& options) {
  const auto model = LoadLinkModel(options.model);
  if (!model) return model.error();
  const int path = options.node[0], ring = options.node[1];
  if (path < 1 || path > model->markers.paths || ring < 1 || ring > model->markers.rings()) {
    return Error{ErrorCode::kInvalidArgument,
                 "no node (" + std::to_string(path) + ", " + std::to_string(ring) + "); model '" +
                     model->name + "' has paths 1 to " + std::to_string(model->markers.paths) +
                     " and rings 1 to " + std::to_string(model->markers.rings())};
  }
  if (auto good = CheckWeight(*model, options.gravity); !good) return good.error();
  Vec3 specific_force_mps2 = Vec3::Zero();
  if (!options.gravity.empty()) {
    const auto given = SpecificForceFrom(options.gravity);
    if (!given) return given.error();
    specific_force_mps2 = *given;
  }
  const auto result = PushSkin(
      *model,
      {.marker = model->MarkerIndex(path - 1, ring - 1),
       .depth_mm = options.depth_mm,
       .pressure_mpa = options.pressure_kpa * 1e-3,
       .specific_force_mps2 = specific_force_mps2,
       .patch_diameter_mm = options.patch_diameter_mm,
       .refinement = options.refinement,
       .force_model = options.force_model == "linear" ? ForceModel::kLinear : ForceModel::kNonlinear});
  if (!result) return result.error();
  if (options.json) {
    std::puts(Json({{"force_n", result->force_n},
                    {"inflation_mm", result->inflation_mm},
                    {"indentation_mm", result->indentation_mm},
                    {"solution", result->solution}})
                  .dump()
                  .c_str());
  } else {
    std::printf("force %.4f N, inflation %.3f mm, nodes in contact %d\n", result->force_n,
                result->inflation_mm, result->nodes_in_contact);
  }
  return {};
}

}  // namespace

void AddSkin(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<PushOptions>();
  const Arguments skin = app.AddCommand("skin", "Evaluate a skin's design");
  skin.RequireCommand();
  const Arguments push = skin.AddCommand("push", "Push the simulated skin with a flat disc at a marker");
  push.AddOption("--model", options->model, "Link model: a shipped name or a YAML file").Required();
  push.AddOption("--node", options->node, "PATH,RING of the marker, from 1")
      .Required()
      .Delimiter(',')
      .Expected(2);
  push.AddOption("--depth-mm", options->depth_mm, "Of the disc, from the uninflated radius")
      .Required()
      .Must(Within(-1e3, 1e3));
  push.AddOption("--pressure-kpa", options->pressure_kpa, "Gauge pressure inside the skin")
      .Must(Within(-20, 20));
  push.AddOption("--gravity", options->gravity,
                 "X,Y,Z: specific force in the link's frame (m/s^2, the direction in which things fall), for "
                 "the skin's weight; without, it is weightless");
  push.AddOption("--patch-diameter-mm", options->patch_diameter_mm, "Of the disc").Must(Within(0, 1e3));
  push.AddOption("--refinement", options->refinement, "Elements per marker interval").Must(Between(1, 8));
  push.AddOption("--force-model", options->force_model, "nonlinear, or linear: small displacements only")
      .Must(OneOf({"nonlinear", "linear"}));
  push.AddFlag("--json", options->json, "One JSON object");
  push.OnChosen([options, &selected] { selected = [options] { return Push(*options); }; });
  AddSkinStiffness(skin, selected);
  AddSkinCheck(skin, selected);
}

}  // namespace taclink::command
