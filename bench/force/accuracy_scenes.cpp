#include "bench/force/accuracy_scenes.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "sensing/core/known_loads.h"
#include "sensing/core/similar_skin.h"

namespace taclink {
namespace {

constexpr double kStampMm = 2.75, kRimMm = 0.25, kSphereMm = 10, kBarMm = 8;
constexpr double kPlateMm = 25, kPlateRimMm = 2;
const double kHalf = std::sqrt(0.5);

// A place of the undeformed outer surface.
struct Place {
  Vec3 point, normal, around, axial;
};

// `path` and `ring` count from 0; halves are between markers.
Place At(const LinkModel& model, double path, double ring) {
  const auto& rings = model.markers.rings_z_mm;
  const auto below =
      std::clamp<size_t>(static_cast<size_t>(std::floor(std::max(ring, 0.0))), 0, rings.size() - 2);
  const double z = rings[below] + (ring - static_cast<double>(below)) * (rings[below + 1] - rings[below]);
  const double angle = model.markers.first_path_angle_rad + path * model.markers.path_pitch_rad();
  const Vec3 normal = model.OutwardNormal(angle, z);
  const Vec3 around(-std::sin(angle), std::cos(angle), 0);
  return {model.PointAtDepth(angle, z, 0), normal, around, normal.cross(around)};
}

PressBody Body(const Place& at, const RigidBody& body, bool sticks) {
  return {body, -at.normal, kHalf * (at.around + at.axial), sticks};
}

// What presses, `unit` times as large.
struct Bodies {
  double unit;

  PressBody Stamp(const Place& at, double radius_mm = kStampMm, double rim_mm = kRimMm) const {
    return Body(at, RigidStamp{at.point, -at.normal, unit * radius_mm, unit * rim_mm}, true);
  }
  PressBody Sphere(const Place& at, bool sticks = false) const {
    return Body(at, RigidSphere{at.point + unit * kSphereMm * at.normal, unit * kSphereMm}, sticks);
  }
  PressBody Bar(const Place& at) const {
    const RigidBar bar{at.point + unit * kBarMm * at.normal, kHalf * (at.around + at.axial), unit * kBarMm};
    return Body(at, bar, false);
  }

  std::vector<PressBody> Of(const LinkModel& model, PressKind kind) const;
};

std::vector<PressBody> Bodies::Of(const LinkModel& model, PressKind kind) const {
  const int paths = model.markers.paths, rings = model.markers.rings();
  const double path = paths / 4, ring = rings / 2 - 1;  // NOLINT(bugprone-integer-division)
  const auto at = [&](double p, double r) { return At(model, p, r); };
  switch (kind) {
    case PressKind::kRest:
      return {};
    case PressKind::kStampMarker:
      return {Stamp(at(path, ring))};
    case PressKind::kStampBetween:
      return {Stamp(at(path + 0.5, ring + 0.5))};
    case PressKind::kSphereMarker:
      return {Sphere(at(path + 1, ring))};
    case PressKind::kSphereBetween:
      return {Sphere(at(path - 0.5, ring + 0.5))};
    case PressKind::kStampEnd:
      return {Stamp(at(path, 0))};
    case PressKind::kSphereEnd:
      return {Sphere(at(path + 0.5, rings - 1.5))};
    case PressKind::kTwo:
      return {Stamp(at(path, ring - 1)), Sphere(at(path + 0.3 * paths, ring + 1.5))};
    case PressKind::kThree:
      return {Sphere(at(1, ring)), Sphere(at(1 + paths / 3.0, ring + 2)),
              Sphere(at(1 + 2 * paths / 3.0, ring - 1.5))};
    case PressKind::kPlate:
      return {Stamp(at(path + 0.5, ring), kPlateMm, kPlateRimMm)};
    case PressKind::kPinch:
      return {Sphere(at(path, ring)), Sphere(at(path + 0.5 * paths, ring))};
    case PressKind::kBar:
      return {Bar(at(path, ring + 0.5))};
    case PressKind::kDrag:
      return {Sphere(at(path + 0.25, ring + 0.25), true)};
  }
  return {};
}

std::vector<PressStage> Stages(PressKind kind) {
  switch (kind) {
    case PressKind::kRest:
      return {};
    case PressKind::kStampMarker:
    case PressKind::kStampBetween:
    case PressKind::kSphereMarker:
    case PressKind::kSphereBetween:
      return {{2}, {5}, {10}, {15}};
    case PressKind::kStampEnd:
      return {{2}, {4}, {6}};
    case PressKind::kSphereEnd:
      return {{2}, {5}, {8}};
    case PressKind::kTwo:
    case PressKind::kThree:
    case PressKind::kPlate:
    case PressKind::kBar:
      return {{5}, {10}};
    case PressKind::kPinch:
      return {{5}, {10}, {15}};
    case PressKind::kDrag:
      return {{8}, {8, 2.5}, {8, 5}};
  }
  return {};
}

struct HeldScene {
  PressKind kind;
  double pressure_mpa;
  const char* attitude;
  Vec3 down;  // unit
};

std::vector<HeldScene> HeldScenes() {
  const Vec3 lying(0, -1, 0), tilted(0, -kHalf, -kHalf), upside_down(0, 0, 1);
  return {{PressKind::kRest, 0, "lying", lying},
          {PressKind::kRest, 0, "upside-down", upside_down},
          {PressKind::kRest, 1e-3, "lying", lying},
          {PressKind::kSphereMarker, 0, "lying", lying},
          {PressKind::kStampMarker, 0, "tilted", tilted},
          {PressKind::kStampMarker, 5e-4, "upside-down", upside_down},
          {PressKind::kSphereMarker, 5e-4, "tilted", tilted},
          {PressKind::kTwo, 1e-3, "lying", lying}};
}

}  // namespace

const char* Name(PressKind kind) {
  constexpr const char* kNames[kPressKindCount] = {
      "rest",      "stamp-marker", "stamp-between", "sphere-marker", "sphere-between",
      "stamp-end", "sphere-end",   "two",           "three",         "plate",
      "pinch",     "bar",          "drag"};
  return kNames[static_cast<size_t>(kind)];
}

SkinUnits UnitsOf(const LinkModel& model) {
  return {.length = LengthUnit(model), .force = ForceUnit(model)};
}

PressPath MakePressPath(const LinkModel& model, PressKind kind, double pressure_mpa, double unit) {
  char pressure[32];
  std::snprintf(pressure, sizeof pressure, "%gkPa", 1e3 * pressure_mpa);
  std::vector<PressStage> stages = Stages(kind);
  for (PressStage& stage : stages) stage = {unit * stage.depth_mm, unit * stage.drag_mm};
  return {.name = std::string(Name(kind)) + "-" + model.name + "-" + pressure,
          .kind = kind,
          .model = model.name,
          .pressure_mpa = pressure_mpa,
          .attitude = {},
          .specific_force_mps2 = Vec3::Zero(),
          .baseline_specific_force_mps2 = Vec3::Zero(),
          .bodies = Bodies{unit}.Of(model, kind),
          .stages = std::move(stages)};
}

PressPath WithWeight(PressPath path, const std::string& attitude, const Vec3& specific_force_mps2) {
  path.name += "-" + attitude;
  path.attitude = attitude;
  path.specific_force_mps2 = specific_force_mps2;
  path.baseline_specific_force_mps2 = Vec3(0, 0, -kStandardGravity);
  return path;
}

std::vector<PressPath> PressPaths(const LinkModel& model, const std::vector<double>& pressures_mpa) {
  constexpr double kSameMpa = 1e-9;
  std::vector<PressPath> paths;
  for (const double pressure : pressures_mpa) {
    for (int kind = 0; kind < kPressKindCount; ++kind)
      paths.push_back(MakePressPath(model, static_cast<PressKind>(kind), pressure));
    if (model.MassPerArea() == 0) continue;
    for (const HeldScene& held : HeldScenes()) {
      if (std::abs(held.pressure_mpa - pressure) > kSameMpa) continue;
      paths.push_back(
          WithWeight(MakePressPath(model, held.kind, pressure), held.attitude, kStandardGravity * held.down));
    }
  }
  return paths;
}

}  // namespace taclink
