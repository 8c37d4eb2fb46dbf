#include "client/command/offline/design_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "client/command/cli/json.h"
#include "client/command/cli/svg.h"
#include "client/command/offline/marker_map_svg.h"
#include "sensing/core/units.h"

namespace taclink::command {
namespace {

std::string StateName(const DesignState& state) {
  if (state.loads == KnownLoads{}) return "slack";
  return fmt::format("at {:g} kPa", state.loads.pressure_mpa / kMpaPerKpa);
}

std::vector<const DesignState*> StatesOf(const SkinDesign& design) {
  std::vector<const DesignState*> states = {&design.slack};
  if (design.loaded) states.push_back(&*design.loaded);
  return states;
}

// The worst of a ring's markers.
struct RingSight {
  int seen[kCameraCount] = {};
  double smallest_px = INFINITY;
  Vec3 sigmas_mm = Vec3::Zero();  // NaN: of a marker that both cameras do not see
};

RingSight SightOf(const LinkModel& model, const DesignState& state, int ring) {
  RingSight sight;
  for (int path = 0; path < model.markers.paths; ++path) {
    const auto m = static_cast<size_t>(model.MarkerIndex(path, ring));
    for (const CameraId id : kBothCameras) {
      const MarkerView& view = state.visibility[id][m];
      if (!view.is_seen()) continue;
      ++sight.seen[Index(id)];
      sight.smallest_px = std::min(sight.smallest_px, view.larger_px());
    }
    const auto& sigmas = state.resolutions[m].sigmas_mm;
    if (!sigmas)
      sight.sigmas_mm.setConstant(NAN);
    else if (sight.sigmas_mm.allFinite())
      sight.sigmas_mm = sight.sigmas_mm.cwiseMax(*sigmas);
  }
  return sight;
}

std::string Number(const std::optional<double>& value, int width, int decimals) {
  if (!value || !std::isfinite(*value)) return fmt::format("{:>{}}", "-", width);
  return fmt::format("{:{}.{}f}", *value, width, decimals);
}

void PrintState(const LinkModel& model, const DesignState& state) {
  fmt::print(
      "\n{}\n ring    z mm   seen top/bottom of {}  smallest px  sigma R,phi,Z mm   least N  range mm  range "
      "N\n",
      StateName(state), model.markers.paths);
  for (int ring = 0; ring < model.markers.rings(); ++ring) {
    const RingSight sight = SightOf(model, state, ring);
    const auto i = static_cast<size_t>(ring);
    fmt::print("{:5d}  {:6.1f}  {:>12}  {:>22}  {:5.2f} {:5.2f} {:5.2f}", ring + 1,
               model.markers.rings_z_mm[i], fmt::format("{}/{}", sight.seen[0], sight.seen[1]),
               Number(sight.smallest_px, 0, 2), sight.sigmas_mm.x(), sight.sigmas_mm.y(),
               sight.sigmas_mm.z());
    if (i < state.forces.by_ring.size()) {
      const RingForce& force = state.forces.by_ring[i];
      fmt::print("  {}  {}  {}", Number(force.least_n, 8, 3), Number(force.range_mm, 8, 1),
                 Number(force.range_n, 7, 2));
    }
    fmt::print("\n");
  }
}

Json OptionalJson(const std::optional<double>& value) {
  return value && std::isfinite(*value) ? Json(*value) : Json(nullptr);
}

Json FindingJson(const Finding& finding) {
  Json json = {{"severity", Name(finding.severity)}, {"id", finding.id}, {"what", finding.what}};
  if (finding.path) json["path"] = *finding.path;
  if (finding.ring) json["ring"] = *finding.ring;
  if (finding.z_mm) json["z_mm"] = *finding.z_mm;
  if (finding.markers > 0) json["markers"] = finding.markers;
  if (finding.value) json["value"] = OptionalJson(finding.value);
  if (finding.limit) json["limit"] = OptionalJson(finding.limit);
  if (!finding.unit.empty()) json["unit"] = finding.unit;
  if (!finding.change.empty()) json["change"] = finding.change;
  return json;
}

Json ViewJson(const MarkerView& view) {
  Json json = {{"sight", Name(view.sight)}};
  if (view.along_px > 0) {
    json["along_px"] = view.along_px;
    json["across_px"] = view.across_px;
    json["margin_px"] = OptionalJson(view.margin_px);
    json["gap_px"] = OptionalJson(view.gap_px);
  }
  return json;
}

const char* NameOf(RingForce::End end) {
  switch (end) {
    case RingForce::End::kTube:
      return "tube";
    case RingForce::End::kSnap:
      return "snap";
    case RingForce::End::kNotSolved:
      break;
  }
  return "not_solved";
}

Json StateJson(const LinkModel& model, const DesignState& state) {
  Json markers = Json::array(), rings = Json::array();
  for (int m = 0; m < model.markers.count(); ++m) {
    const auto i = static_cast<size_t>(m);
    Json one = {{"path", model.PathOf(m) + 1}, {"ring", model.RingOf(m) + 1}};
    for (const CameraId id : kBothCameras) one[Name(id)] = ViewJson(state.visibility[id][i]);
    const auto& sigmas = state.resolutions[i].sigmas_mm;
    one["sigma_mm"] = sigmas && sigmas->allFinite() ? ToJson(*sigmas) : Json(nullptr);
    markers.push_back(std::move(one));
  }
  for (size_t ring = 0; ring < state.forces.by_ring.size(); ++ring) {
    const RingForce& force = state.forces.by_ring[ring];
    rings.push_back({{"ring", ring + 1},
                     {"z_mm", model.markers.rings_z_mm[ring]},
                     {"least_n", OptionalJson(force.least_n)},
                     {"room_mm", force.room_mm},
                     {"range_mm", OptionalJson(force.range_mm)},
                     {"range_n", OptionalJson(force.range_n)},
                     {"range_ends", NameOf(force.end)}});
  }
  Json blind = Json::object();
  for (const CameraId id : kBothCameras) {
    const BlindZone& zone = state.visibility.blind[Index(id)];
    blind[Name(id)] = {{"top_mm", zone.top_mm}, {"bottom_mm", zone.bottom_mm}};
  }
  blind["both"] = {{"top_mm", state.visibility.blind_to_both.top_mm},
                   {"bottom_mm", state.visibility.blind_to_both.bottom_mm}};
  return {{"pressure_kpa", state.loads.pressure_mpa / kMpaPerKpa},
          {"specific_force_mps2", ToJson(state.loads.specific_force_mps2)},
          {"growth_mm", state.forces.growth_mm},
          {"blind_zones", blind},
          {"rings", rings},
          {"markers", markers}};
}

Json WeightJson(const SkinDesign& design) {
  if (!design.sag) return nullptr;
  Json sag = Json::object();
  for (const Attitude attitude : kAttitudes)
    sag[Name(attitude)] = OptionalJson(design.sag->sag_mm[static_cast<size_t>(attitude)]);
  return {{"mass_kg", design.sag->mass_kg}, {"sag_mm", sag}};
}

Json PressureJson(const PressureLimits& limits) {
  const auto kpa = [](const std::optional<double>& mpa) {
    return mpa ? Json(*mpa / kMpaPerKpa) : Json(nullptr);
  };
  return {{"searched_kpa", limits.searched_mpa / kMpaPerKpa},
          {"buckles_kpa", kpa(limits.buckles_mpa)},
          {"runs_away_kpa", kpa(limits.runs_away_mpa)}};
}

template <typename Value>
MarkerMapValues MapOf(const LinkModel& model, const std::string& title, const std::string& unit,
                      Value value) {
  MarkerMapValues map{.title = title, .unit = unit, .values = {}};
  for (int m = 0; m < model.markers.count(); ++m) map.values.push_back(value(m));
  return map;
}

}  // namespace

void PrintDesign(const SkinDesign& design, const std::vector<Finding>& findings) {
  fmt::print("{}: {} paths x {} rings, {:g} mm long\n", design.model.name, design.model.markers.paths,
             design.model.markers.rings(), design.model.length_mm);
  for (const Finding& finding : findings) {
    std::string where;
    if (finding.path && finding.ring)
      where = fmt::format(" [path {}, ring {}, z {:g} mm]", *finding.path, *finding.ring,
                          finding.z_mm.value_or(0));
    else if (finding.z_mm)
      where = fmt::format(" [z {:.1f} mm]", *finding.z_mm);
    fmt::print("{:<8} {}: {}{}\n", Name(finding.severity), finding.id, finding.what, where);
    if (!finding.change.empty()) fmt::print("         change: {}\n", finding.change);
  }
  for (const DesignState* state : StatesOf(design)) PrintState(design.model, *state);
}

std::string DesignJson(const SkinDesign& design, const std::vector<Finding>& findings) {
  Json list = Json::array();
  for (const Finding& finding : findings) list.push_back(FindingJson(finding));
  const auto faults = std::ranges::count(findings, Severity::kFault, &Finding::severity);
  return Json({{"model", design.model.name},
               {"faults", faults},
               {"marker_sigma_px", design.options.marker_sigma_px},
               {"findings", list},
               {"pressure_limits", PressureJson(design.pressure)},
               {"weight", WeightJson(design)},
               {"slack", StateJson(design.model, design.slack)},
               {"loaded", design.loaded ? StateJson(design.model, *design.loaded) : Json(nullptr)}})
      .dump();
}

std::vector<std::pair<std::string, std::string>> DesignMaps(const SkinDesign& design) {
  const LinkModel& model = design.model;
  std::vector<std::pair<std::string, std::string>> maps;
  for (const DesignState* state : StatesOf(design)) {
    const std::string prefix = state == &design.slack ? "slack" : "loaded", of = ", " + StateName(*state);
    const auto add = [&](const std::string& name, const MarkerMapValues& map) {
      maps.emplace_back(prefix + "_" + name + ".svg", MarkerMapSvg(model, map));
    };
    const std::pair<const char*, int> axes[] = {{"R", 0}, {"phi", 1}, {"Z", 2}};
    for (const auto& [axis, index] : axes) {
      add(std::string("sigma_") + axis,
          MapOf(model, std::string("standard deviation of a marker's ") + axis + of, "mm", [&](int m) {
            const auto& sigmas = state->resolutions[static_cast<size_t>(m)].sigmas_mm;
            return sigmas ? (*sigmas)[index] : NAN;
          }));
    }
    for (const CameraId id : kBothCameras) {
      add(std::string("size_") + Name(id),
          MapOf(model, std::string("size of a marker, ") + Name(id) + " camera" + of, "px", [&](int m) {
            const MarkerView& view = state->visibility[id][static_cast<size_t>(m)];
            return view.is_seen() ? view.larger_px() : NAN;
          }));
    }
    if (state->forces.by_ring.empty()) continue;
    const auto of_ring = [&](int m) -> const RingForce& {
      return state->forces.by_ring[static_cast<size_t>(model.RingOf(m))];
    };
    add("least_force", MapOf(model, "least detectable force" + of, "N",
                             [&](int m) { return of_ring(m).least_n.value_or(NAN); }));
    add("range",
        MapOf(model, "working range" + of, "mm", [&](int m) { return of_ring(m).range_mm.value_or(NAN); }));
  }
  return maps;
}

std::string DesignHtml(const SkinDesign& design, const std::vector<Finding>& findings) {
  const std::string name = svg::Escaped(design.model.name);
  std::string out = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title>\n"
      "<style>body{{font-family:sans-serif}} td,th{{padding:2px 8px;text-align:left;vertical-align:top}} "
      ".fault{{color:#b00020}} .warning{{color:#8a5a00}}</style></head>\n<body><h1>{0}</h1>\n"
      "<table><tr><th></th><th>finding</th><th>where</th><th>change</th></tr>\n",
      name);
  for (const Finding& finding : findings) {
    const std::string where = finding.path && finding.ring
                                  ? fmt::format("path {}, ring {}", *finding.path, *finding.ring)
                              : finding.z_mm ? fmt::format("z {:.1f} mm", *finding.z_mm)
                                             : "";
    out +=
        fmt::format("<tr class=\"{0}\"><td>{0}</td><td>{1}</td><td>{2}</td><td>{3}</td></tr>\n",
                    Name(finding.severity), svg::Escaped(finding.what), where, svg::Escaped(finding.change));
  }
  out += "</table>\n";
  for (const auto& [file, map] : DesignMaps(design)) out += map;
  return out + "</body></html>\n";
}

}  // namespace taclink::command
