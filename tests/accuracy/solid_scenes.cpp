#include "tests/accuracy/solid_scenes.h"

#include <cmath>
#include <fstream>
#include <map>
#include <sstream>

#include "sensing/model/model_file.h"
#include "tests/support/paths.h"

namespace taclink {
namespace {

using Row = std::map<std::string, std::string>;

std::vector<std::string> Cells(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
}

std::string Folder() {
  return testing::CalculixData("");
}

std::vector<Row> Table(const std::string& name) {
  std::ifstream file(Folder() + name);
  std::string line;
  std::getline(file, line);
  const std::vector<std::string> head = Cells(line);
  std::vector<Row> rows;
  while (std::getline(file, line)) {
    const std::vector<std::string> cells = Cells(line);
    Row row;
    for (size_t i = 0; i < head.size() && i < cells.size(); ++i) row[head[i]] = cells[i];
    rows.push_back(row);
  }
  return rows;
}

std::map<std::string, std::vector<Vec3>> Markers(const std::string& name) {
  std::ifstream file(Folder() + name);
  std::map<std::string, std::vector<Vec3>> all;
  std::string line;
  while (std::getline(file, line)) {
    const std::vector<std::string> cells = Cells(line);
    if (cells.size() < 721 || cells[0] == "scene") continue;
    std::vector<Vec3>& markers = all[cells[0]];
    for (size_t m = 0; m < 240; ++m)
      markers.emplace_back(std::stod(cells[3 * m + 1]), std::stod(cells[3 * m + 2]),
                           std::stod(cells[3 * m + 3]));
  }
  return all;
}

double Number(const Row& row, const std::string& key) {
  return std::stod(row.at(key));
}

void AddContacts(const std::string& table, std::vector<SolidScene>& scenes) {
  for (const Row& row : Table(table)) {
    for (SolidScene& scene : scenes) {
      if (scene.name != row.at("scene")) continue;
      scene.contacts.push_back(
          {.kind = row.at("kind"),
           .glued = row.at("glued") == "1",
           .force_n = {Number(row, "fx_n"), Number(row, "fy_n"), Number(row, "fz_n")},
           .normal_force_n = Number(row, "normal_force_n"),
           .center_mm = {Number(row, "cx_mm"), Number(row, "cy_mm"), Number(row, "cz_mm")},
           .extent_mm = {Number(row, "ext_around_mm"), Number(row, "ext_along_mm")}});
    }
  }
}

}  // namespace

bool SolidScene::IsDistributed() const {
  if (contacts.size() > 3) return true;
  for (const SolidContact& contact : contacts) {
    if (contact.extent_mm.maxCoeff() > 15) return true;
  }
  return false;
}

std::vector<SolidScene> ReadSolidScenes() {
  const auto markers = Markers("scene_markers.csv");
  std::vector<SolidScene> scenes;
  for (const Row& row : Table("scenes.csv")) {
    SolidScene scene;
    scene.name = row.at("scene");
    scene.family = row.at("family");
    scene.held_out = row.at("held_out") == "1";
    scene.pressure_kpa = Number(row, "pressure_kpa");
    scene.baseline_kpa = Number(row, "baseline_kpa");
    if (!markers.contains(scene.name)) continue;
    scene.markers_mm = markers.at(scene.name);
    scene.baseline_mm.assign(scene.markers_mm.size(), Vec3::Zero());
    if (scene.baseline_kpa > 0) {
      const auto base =
          markers.find("inflated_" + std::to_string(std::lround(1e3 * scene.baseline_kpa)) + "pa");
      if (base == markers.end()) continue;
      scene.baseline_mm = base->second;
    }
    scenes.push_back(std::move(scene));
  }
  AddContacts("scene_contacts.csv", scenes);
  return scenes;
}

std::vector<SolidScene> ReadWeightScenes() {
  const auto markers = Markers("weight_markers.csv");
  std::vector<SolidScene> states;
  for (const Row& row : Table("weight_states.csv")) {
    SolidScene& state = states.emplace_back();
    state.name = row.at("scene");
    state.family = "weight";
    state.pressure_kpa = Number(row, "pressure_kpa");
    state.specific_force_mps2 = {Number(row, "gx_mps2"), Number(row, "gy_mps2"), Number(row, "gz_mps2")};
    state.markers_mm = markers.at(state.name);
  }
  AddContacts("weight_contacts.csv", states);
  std::vector<SolidScene> scenes;
  for (const SolidScene& baseline : states) {
    for (const SolidScene& state : states) {
      if (!baseline.contacts.empty() || state.specific_force_mps2 == baseline.specific_force_mps2) continue;
      SolidScene& scene = scenes.emplace_back(state);
      scene.name = baseline.name + " to " + state.name;
      scene.baseline_kpa = baseline.pressure_kpa;
      scene.baseline_mm = baseline.markers_mm;
      scene.baseline_specific_force_mps2 = baseline.specific_force_mps2;
    }
  }
  return scenes;
}

LinkModel SolidSkin() {
  LinkModel model = LoadLinkModel("cylinder").value();
  model.material = {.youngs_modulus_mpa = 0.1, .poisson_ratio = 0.5, .law = MaterialLaw::kNeoHookean};
  return model;
}

}  // namespace taclink
