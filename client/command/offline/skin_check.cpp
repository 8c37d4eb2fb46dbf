#include "sensing/design/skin_check.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "client/command/cli/output_files.h"
#include "client/command/cli/progress.h"
#include "client/command/offline/design_report.h"
#include "client/command/offline/gravity.h"
#include "client/command/offline/skin_commands.h"
#include "sensing/core/units.h"
#include "sensing/model/model_file.h"

namespace taclink::command {
namespace {

struct CheckOptionsGiven {
  std::string model;
  std::string gravity;
  double pressure_kpa = 1.5;
  double least_force_n = 0.1;
  double contact_diameter_mm = 5.5;
  std::string html, svg_dir;
  bool json = false;
};

Result<void> WriteMaps(const std::string& folder, const SkinDesign& design) {
  if (folder.empty()) return {};
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    return Error{ErrorCode::kUnavailable, folder + ": this folder cannot be made: " + error.message()};
  }
  for (const auto& [file, text] : DesignMaps(design)) {
    const std::string path = (std::filesystem::path(folder) / file).string();
    if (auto written = WriteText(path, text); !written) return written;
  }
  return {};
}

Result<void> CheckDesign(const CheckOptionsGiven& given) {
  const auto model = LoadLinkModel(given.model);
  if (!model) return model.error();
  if (auto good = CheckWeight(*model, given.gravity); !good) return good;
  SkinCheckOptions options{.pressure_mpa = given.pressure_kpa * kMpaPerKpa,
                           .least_force_n = given.least_force_n,
                           .contact_diameter_mm = given.contact_diameter_mm};
  if (!given.gravity.empty()) {
    const auto mps2 = SpecificForceFrom(given.gravity);
    if (!mps2) return mps2.error();
    options.specific_force_mps2 = *mps2;
  }
  if (auto good = CheckWritable({given.html}); !good) return good;
  Result<SkinDesign> design = [&] {
    Progress progress("the design");
    return AnalyzeSkin(*model, options, [&](double share) { progress.Show(share); });
  }();
  if (!design) return design.error();
  const std::vector<Finding> findings = FindingsOf(*design);
  if (!given.html.empty()) {
    if (auto written = WriteText(given.html, DesignHtml(*design, findings)); !written) return written;
  }
  if (auto written = WriteMaps(given.svg_dir, *design); !written) return written;
  if (given.json) {
    std::puts(DesignJson(*design, findings).c_str());
  } else {
    PrintDesign(*design, findings);
  }
  const auto faults = std::ranges::count(findings, Severity::kFault, &Finding::severity);
  if (faults == 0) return {};
  return Error{ErrorCode::kFailedPrecondition, "model '" + model->name + "' has " + std::to_string(faults) +
                                                   (faults == 1 ? " fault" : " faults") +
                                                   ", of which each is listed with what to change"};
}

}  // namespace

void AddSkinCheck(const Arguments& skin, Selected& selected) {
  auto options = std::make_shared<CheckOptionsGiven>();
  const Arguments command = skin.AddCommand(
      "check", "Whether a design works, before it is built, and what to change; fails if it has a fault");
  command.AddOption("--model", options->model, "Link model: a shipped name or a YAML file").Required();
  command
      .AddOption("--pressure-kpa", options->pressure_kpa, "Highest gauge pressure that the link is meant for")
      .Must(Within(0, 20))
      .ShowDefault();
  command.AddOption(
      "--gravity", options->gravity,
      "X,Y,Z: specific force in the link's frame (m/s^2) beside that pressure, for the skin's weight; "
      "without, it is weightless there");
  command.AddOption("--least-force-n", options->least_force_n, "That the link is meant to feel everywhere")
      .Must(Within(1e-6, 1e6))
      .ShowDefault();
  command
      .AddOption("--contact-diameter-mm", options->contact_diameter_mm,
                 "Of the smallest body that is meant to touch it")
      .Must(Within(0.1, 1e3))
      .ShowDefault();
  command.AddOption("--html", options->html, "Page to write findings and maps to");
  command.AddOption("--svg-dir", options->svg_dir, "Folder to write the maps to, an SVG file each");
  command.AddFlag("--json", options->json, "One JSON object, with every ring and marker");
  command.OnChosen([options, &selected] { selected = [options] { return CheckDesign(*options); }; });
}

}  // namespace taclink::command
