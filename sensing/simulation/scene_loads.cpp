#include "sensing/simulation/scene_loads.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "sensing/core/units.h"

namespace taclink {
namespace {

constexpr double kSameS = 1e-6;  // times that are the same
constexpr int kFreeSkins = 5;

}  // namespace

SceneLoads::SceneLoads(const LinkModel& model, const Scene& scene, std::vector<ContactPlan> plans,
                       const ShellMesh& mesh)
    : model_(model), scene_(scene), plans_(std::move(plans)), finder_(model, mesh) {
  FindParts();
}

// Parts end where a ramp, a slide or a line of the pressure does.
void SceneLoads::FindParts() {
  std::vector<double> times = {0, scene_.duration_s};
  for (const PressureKey& key : scene_.pressure) times.push_back(key.time_s);
  for (const ContactPlan& plan : plans_) {
    times.insert(times.end(),
                 {plan.begin_s, plan.begin_s + plan.ramp_s, plan.end_s - plan.ramp_s, plan.end_s});
  }
  // A swing goes back through the states of its way there.
  if (scene_.motion && scene_.motion->swing) {
    const double half_s = scene_.motion->swing->period_s / 2;
    for (double t = half_s; t < scene_.duration_s; t += half_s) times.push_back(t);
  }
  std::sort(times.begin(), times.end());
  std::erase_if(times, [&](double t) { return t < 0 || t > scene_.duration_s; });
  for (size_t i = 0; i + 1 < times.size(); ++i) {
    ScenePart part{times[i], times[i + 1], {}, true};
    if (part.end_s - part.begin_s < kSameS) continue;
    const double middle = (part.begin_s + part.end_s) / 2;
    part.still = scene_.PressureKpa(part.begin_s) == scene_.PressureKpa(part.end_s) &&
                 !(scene_.motion && scene_.motion->swing);
    for (const ContactPlan& plan : plans_) {
      part.pressing.push_back(plan.begin_s < middle && middle < plan.end_s);
      if (part.pressing.back() && (plan.moves || plan.Level(middle) < 1)) part.still = false;
    }
    parts_.push_back(std::move(part));
  }
}

double SceneLoads::PressureMpa(const ScenePart& part, double time_s) const {
  const double from = scene_.PressureKpa(part.begin_s), to = scene_.PressureKpa(part.end_s);
  const double share = (time_s - part.begin_s) / (part.end_s - part.begin_s);
  return kMpaPerKpa * (from + share * (to - from));
}

std::vector<double> SceneLoads::FreePressures() const {
  const auto less = [](const PressureKey& a, const PressureKey& b) { return a.kpa < b.kpa; };
  const auto [low, high] = std::minmax_element(scene_.pressure.begin(), scene_.pressure.end(), less);
  const bool by_depth = std::any_of(scene_.contacts.begin(), scene_.contacts.end(),
                                    [](const SceneContact& contact) { return contact.depth_mm.has_value(); });
  if (!by_depth || (low->kpa == 0 && high->kpa == 0)) return {};
  if (low->kpa == high->kpa) return {kMpaPerKpa * low->kpa};
  std::vector<double> pressures;
  for (int i = 0; i < kFreeSkins; ++i)
    pressures.push_back(kMpaPerKpa * (low->kpa + (high->kpa - low->kpa) * i / (kFreeSkins - 1)));
  return pressures;
}

double SceneLoads::FreeDepth(size_t contact, const SkinSpot& spot, double pressure_mpa) const {
  if (free_skins_.empty()) return 0;
  const std::vector<double> pressures = FreePressures();
  double depth = 0;  // Lagrange's polynomial
  for (size_t i = 0; i < pressures.size(); ++i) {
    double share = 1;
    for (size_t j = 0; j < pressures.size(); ++j) {
      if (j != i) share *= (pressure_mpa - pressures[j]) / (pressures[i] - pressures[j]);
    }
    depth += share * TouchingDepth(contact, spot, free_skins_[i]);
  }
  return depth;
}

const ScenePart& SceneLoads::PartAt(double time_s) const {
  return *std::find_if(parts_.begin(), parts_.end() - 1,
                       [&](const ScenePart& part) { return time_s < part.end_s; });
}

double SceneLoads::TouchingDepth(double diameter_mm, const SkinSpot& spot, const ShellState& state) const {
  const Vec3 origin = model_.PointAtDepth(spot.angle_rad, spot.z_mm, 0);
  const Vec3 normal = model_.OutwardNormal(spot.angle_rad, spot.z_mm);
  const ShellState& now = state;
  const auto height = [&](double angle, double z) {
    finder_.AtPoint(angle, z, weights_);
    double sum = 0;
    for (const NodeWeight& w : weights_)
      sum += w.weight * normal.dot(now.AtOffset(w.node, model_.thickness_mm / 2) - origin);
    return sum;
  };
  constexpr int kAround = 12, kRings = 2;
  const double radius = diameter_mm / 2;
  const double skin_radius = origin.head<2>().norm();
  double highest = height(spot.angle_rad, spot.z_mm);
  for (int i = 0; i < kAround * kRings; ++i) {
    const double turn = 2 * kPi * i / kAround, at = radius * (1 + i / kAround) / kRings;
    const double z = std::clamp(spot.z_mm + at * std::sin(turn), 0.0, model_.length_mm);
    highest = std::max(highest, height(spot.angle_rad + at * std::cos(turn) / skin_radius, z));
  }
  return -highest;
}

SkinLoad SceneLoads::At(const ScenePart& part, double time_s, double on_at_s) const {
  SkinLoad load{.pressure_mpa = PressureMpa(part, time_s), .discs = {}};
  load.specific_force_mps2 = scene_.SpecificForceOf(model_.length_mm, time_s);
  for (size_t i = 0; i < plans_.size(); ++i) {
    SkinDisc& disc = load.discs.emplace_back();
    const ContactPlan& plan = plans_[i];
    const SceneContact& contact = scene_.contacts[i];
    const double level = plan.ramp_s == 0 ? 1 : plan.Level(time_s);
    disc.on = part.pressing[i] && (plan.ramp_s == 0 || plan.Level(on_at_s) > 0);
    if (!disc.on) continue;
    const SkinSpot spot = plan.SpotAt(time_s);
    disc.angle_rad = spot.angle_rad;
    disc.z_mm = spot.z_mm;
    disc.diameter_mm = contact.patch_diameter_mm;
    disc.depth_mm = MostDepth(model_, spot);
    if (contact.force_n) {
      disc.force_n = level * *contact.force_n;
      continue;
    }
    disc.depth_mm = std::min(disc.depth_mm, AskedDepth(i, spot, level, load.pressure_mpa));
  }
  return load;
}

double SceneLoads::AskedDepth(size_t contact, const SkinSpot& spot, double level, double pressure_mpa) const {
  const double free = level < 1 ? FreeDepth(contact, spot, pressure_mpa) : 0;
  return (1 - level) * free + level * *scene_.contacts[contact].depth_mm;
}

bool SceneLoads::StopsShort(size_t contact, const SkinLoad& load, double time_s) const {
  const SkinDisc& disc = load.discs[contact];
  if (!disc.on || disc.force_n) return false;
  const ContactPlan& plan = plans_[contact];
  const double level = plan.ramp_s == 0 ? 1 : plan.Level(time_s);
  return AskedDepth(contact, {disc.angle_rad, disc.z_mm}, level, load.pressure_mpa) > disc.depth_mm;
}

}  // namespace taclink
