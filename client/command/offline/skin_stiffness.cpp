#include <algorithm>
#include <cstdio>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/command/cli/csv.h"
#include "client/command/cli/output_files.h"
#include "client/command/cli/progress.h"
#include "client/command/offline/gravity.h"
#include "client/command/offline/probe_csv.h"
#include "client/command/offline/skin_commands.h"
#include "client/command/offline/stiffness_report.h"
#include "sensing/core/units.h"
#include "sensing/model/model_file.h"

namespace taclink::command {
namespace {

struct StiffnessOptions {
  std::string model;
  std::vector<double> pressures_kpa = {0, 0.5, 1, 1.5};
  std::vector<std::string> places = {"all"};
  double depth_mm = 5;
  double patch_diameter_mm = 5.5;
  std::string gravity;
  int refinement = 3;
  std::string csv, svg, compare;
  bool json = false;
};

struct SkinPlace {
  int path = 0, ring = 0;  // from 0
};

Result<SkinPlace> PlaceFrom(const std::string& text, const LinkModel& model) {
  const std::vector<std::string> words = CsvFields(text);
  SkinPlace place;
  if (words.size() == 2 && ParseWhole(words[0], place.path) && ParseWhole(words[1], place.ring) &&
      place.path >= 1 && place.path <= model.markers.paths && place.ring >= 1 &&
      place.ring <= model.markers.rings())
    return SkinPlace{place.path - 1, place.ring - 1};
  return Error{ErrorCode::kInvalidArgument, "--places: '" + text + "' is not a place PATH,RING; model '" +
                                                model.name + "' has paths 1 to " +
                                                std::to_string(model.markers.paths) + " and rings 1 to " +
                                                std::to_string(model.markers.rings())};
}

// Without gravity nothing tells the paths apart: "all" is then the first one.
Result<std::vector<SkinPlace>> PlacesOf(const StiffnessOptions& options, const LinkModel& model) {
  std::vector<SkinPlace> places;
  for (const std::string& text : options.places) {
    if (text == "all") {
      const int paths = options.gravity.empty() ? 1 : model.markers.paths;
      for (int path = 0; path < paths; ++path)
        for (int ring = 0; ring < model.markers.rings(); ++ring) places.push_back({path, ring});
      continue;
    }
    const auto place = PlaceFrom(text, model);
    if (!place) return place.error();
    places.push_back(*place);
  }
  return places;
}

Result<StiffnessReport> Evaluate(const StiffnessOptions& options, const LinkModel& model,
                                 const Vec3& specific_force_mps2) {
  const auto places = PlacesOf(options, model);
  if (!places) return places.error();
  StiffnessReport report{
      .model = model.name,
      .indentation_mm = options.depth_mm,
      .disc_diameter_mm = options.patch_diameter_mm,
      .is_one_path = options.gravity.empty() && std::ranges::count(options.places, "all") > 0,
      .rows = {}};
  Progress progress("the places");
  const size_t all = options.pressures_kpa.size() * places->size();
  bool any = false;
  for (const double pressure_kpa : options.pressures_kpa) {
    auto skin = LoadedSkin::Make(model, {pressure_kpa * kMpaPerKpa, specific_force_mps2},
                                 {.refinement = options.refinement});
    for (const auto& [path, ring] : *places) {
      StiffnessRow& row = report.rows.emplace_back();
      row.path = path + 1;
      row.ring = ring + 1;
      row.z_mm = model.markers.rings_z_mm[static_cast<size_t>(ring)];
      row.pressure_kpa = pressure_kpa;
      row.stiffness =
          skin ? skin->Stiffness(model.MarkerIndex(path, ring), options.depth_mm, options.patch_diameter_mm)
               : Result<SkinStiffness>(skin.error());
      any = any || row.stiffness.ok();
      progress.Show(static_cast<double>(report.rows.size()) / static_cast<double>(all));
    }
  }
  if (!any) return report.rows.front().stiffness.error();
  return report;
}

// Pushes of the same pressure share the inflated skin.
Result<std::vector<ComparedRow>> CompareForces(const StiffnessOptions& options, const LinkModel& model,
                                               const Vec3& specific_force_mps2) {
  auto records = ReadProbeCsv(options.compare, model, options.patch_diameter_mm);
  if (!records) return records.error();
  std::vector<ComparedRow> rows;
  std::set<double> pressures_mpa;
  for (ProbeRecord& record : *records) {
    pressures_mpa.insert(record.pressure_mpa);
    rows.push_back({std::move(record), 0});
  }
  Progress progress("the rows");
  double done = 0;
  for (const double pressure_mpa : pressures_mpa) {
    auto skin =
        LoadedSkin::Make(model, {pressure_mpa, specific_force_mps2}, {.refinement = options.refinement});
    for (ComparedRow& row : rows) {
      if (row.measured.pressure_mpa != pressure_mpa) continue;
      if (!skin) return Error{skin.error().code, row.measured.name + ": " + skin.error().message};
      const auto pushed = skin->Push(model.MarkerIndex(0, row.measured.ring), {&row.measured.depth_mm, 1},
                                     row.measured.diameter_mm);
      if (!pushed) return Error{pushed.error().code, row.measured.name + ": " + pushed.error().message};
      row.computed_n = pushed->front().force_n;
      progress.Show(++done / static_cast<double>(rows.size()));
    }
  }
  return rows;
}

Result<void> Compare(const StiffnessOptions& options, const LinkModel& model,
                     const Vec3& specific_force_mps2) {
  const auto rows = CompareForces(options, model, specific_force_mps2);
  if (!rows) return rows.error();
  if (auto written = WriteText(options.csv, ComparisonCsv(*rows)); !written) return written;
  if (options.json) {
    std::puts(ComparisonJson(model.name, *rows).c_str());
  } else {
    PrintComparison(*rows);
  }
  return {};
}

Result<void> Stiffness(const StiffnessOptions& options) {
  const auto model = LoadLinkModel(options.model);
  if (!model) return model.error();
  if (auto good = CheckWeight(*model, options.gravity); !good) return good;
  Vec3 specific_force_mps2 = Vec3::Zero();
  if (!options.gravity.empty()) {
    const auto given = SpecificForceFrom(options.gravity);
    if (!given) return given.error();
    specific_force_mps2 = *given;
  }
  if (auto good = CheckWritable({options.csv, options.svg}); !good) return good;
  if (!options.compare.empty()) return Compare(options, *model, specific_force_mps2);
  const auto report = Evaluate(options, *model, specific_force_mps2);
  if (!report) return report.error();
  if (auto written = WriteText(options.csv, StiffnessCsv(*report)); !written) return written;
  if (auto written = WriteText(options.svg, StiffnessSvg(*report)); !written) return written;
  if (options.json) {
    std::puts(StiffnessJson(*report).c_str());
  } else {
    PrintStiffness(*report);
  }
  return {};
}

}  // namespace

void AddSkinStiffness(const Arguments& skin, Selected& selected) {
  auto options = std::make_shared<StiffnessOptions>();
  const Arguments command =
      skin.AddCommand("stiffness", "Stiffness of the skin against a flat disc, by place and gauge pressure");
  command.AddOption("--model", options->model, "Link model: a shipped name or a YAML file").Required();
  const Option pressures =
      command
          .AddOption("--pressures", options->pressures_kpa, "Gauge pressures inside the skin, kPa: 0,0.5,1")
          .Delimiter(',')
          .Must(Within(-20, 20));
  const Option places = command.AddOption("--places", options->places,
                                          "PATH,RING of markers, from 1, or all: without gravity the rings "
                                          "of path 1, which stands for all paths");
  const Option depth = command
                           .AddOption("--depth-mm", options->depth_mm,
                                      "Of the disc, from the surface under the pressure, where it touches")
                           .Must(Within(0.01, 1e3))
                           .ShowDefault();
  command.AddOption("--patch-diameter-mm", options->patch_diameter_mm, "Of the disc")
      .Must(Within(0, 1e3))
      .ShowDefault();
  command.AddOption(
      "--gravity", options->gravity,
      "X,Y,Z: specific force in the link's frame (m/s^2), for the skin's weight; without, it is "
      "weightless");
  command.AddOption("--refinement", options->refinement, "Elements per marker interval")
      .Must(Between(1, 8))
      .ShowDefault();
  command.AddOption("--csv", options->csv, "File to write the table to");
  const Option svg = command.AddOption("--svg", options->svg, "File to draw stiffness against pressure in");
  command
      .AddOption(
          "--compare", options->compare,
          "CSV of measured forces instead: columns ring (or j), depth_mm (from the uninflated radius), "
          "pressure_kpa, force_n; prints measured, computed and error of each row")
      .Excludes(pressures)
      .Excludes(places)
      .Excludes(depth)
      .Excludes(svg);
  command.AddFlag("--json", options->json, "One JSON object");
  command.OnChosen([options, &selected] { selected = [options] { return Stiffness(*options); }; });
}

}  // namespace taclink::command
