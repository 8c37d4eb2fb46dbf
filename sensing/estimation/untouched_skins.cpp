#include "sensing/estimation/untouched_skins.h"

#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

constexpr int kParts = 4;  // of SkinMechanics::pressure_step: the grid of pressures
constexpr int kMostInflationSteps = 400, kMostForceSteps = 1'000'000;
constexpr double kToleranceMm = 1e-4, kLongestStepMm = 8;  // in length units
// RingEquilibrium::Stability above which a skin does not become unstable within a step of the grid.
constexpr double kSurelyStable = 0.5;
constexpr double kResponseTolerance = 0.05;
constexpr int kForgivenSteps = 2;   // that a pressure may be beyond what the skin stands
constexpr double kSagStepMm = 0.5;  // in length units: by which a step of specific force moves the slack skin
constexpr size_t kMostInflated = 24, kMostExpansions = 32;  // that are kept, some 0.15 MB each
// Largest relative difference between the marker derivatives by known loads of the skin with its weight and
// of the inflated skin, up to which the latter's stiffness is taken for both. Contact loads then differ by
// less than half of it, as they do between tangents 0.4 mm of inflation apart.
constexpr double kAboutAsStiff = 0.25;

// The mid-surface lies half the wall's thickness outside of what touches the tube, so that the search may
// pass a little beyond what is accepted.
EnergySearchOptions SearchOptions(const SkinMechanics& mechanics) {
  const double tube_mm = mechanics.model().tube_outer_radius_mm;
  return {.tolerance_mm = kToleranceMm * mechanics.length_unit(),
          .longest_step_mm = kLongestStepMm * mechanics.length_unit(),
          .least_radius_mm = tube_mm > 0 ? tube_mm : -1};
}

template <typename Map>
void EraseOldest(Map& map) {
  map.erase(std::ranges::min_element(map, {}, [](const auto& each) { return each.second.used; }));
}

}  // namespace

UntouchedSkins::UntouchedSkins(const SkinMechanics& mechanics)
    : mechanics_(mechanics),
      part_mpa_(mechanics.pressure_step() / kParts),
      is_round_(RingBlocks::Fit(mechanics.shell())),
      equilibrium_(mechanics.shell(), SearchOptions(mechanics)),
      jacobian_(mechanics.markers().MakeJacobian(mechanics.shell())) {
  if (mechanics.mass_per_area() == 0) return;
  const Answer* slack = Expanded({});
  if (slack == nullptr || !slack->is_found) return;
  const double mm_per_mps2 = slack->skin.markers_by_loads.rightCols<3>().cwiseAbs().maxCoeff();
  if (mm_per_mps2 > 0) specific_force_step_mps2_ = kSagStepMm * mechanics.length_unit() / mm_per_mps2;
}

UntouchedSkins::~UntouchedSkins() = default;

// Returns nullptr if no stable equilibrium exists at this pressure or, under suction, at a smaller suction of
// the grid.
UntouchedSkins::Inflation UntouchedSkins::Inflated(int part) {
  const auto at = [this](int each) {
    if (const auto found = inflated_.find(each); found != inflated_.end()) {
      found->second.used = calls_;
      return found->second.skin;
    }
    if (inflated_.size() >= kMostInflated) EraseOldest(inflated_);
    auto skin = is_round_ ? Inflate(mechanics_.shell(), each * part_mpa_) : std::nullopt;
    Inflation made = skin ? std::make_shared<const InflatedSkin>(*std::move(skin)) : nullptr;
    inflated_[each] = {made, calls_};
    return made;
  };
  for (int before = -kParts; before > part; before -= kParts) {
    if (!at(before)) return nullptr;
  }
  return at(part);
}

// The inflated skin whose stiffness is taken at this pressure. Under suction an equilibrium may be unstable,
// unless the next one of the grid is stable.
UntouchedSkins::Inflation UntouchedSkins::Base(double pressure_mpa) {
  const double parts = pressure_mpa / part_mpa_;
  const auto nearest = static_cast<int>(std::round(parts)), beyond = static_cast<int>(std::floor(parts));
  if (pressure_mpa >= 0 || Inflated(beyond)) return Inflated(nearest);
  if (!Inflated(beyond + 1)) return nullptr;
  auto exact = Inflate(mechanics_.shell(), pressure_mpa);
  return exact ? std::make_shared<const InflatedSkin>(*std::move(exact)) : nullptr;
}

const UntouchedSkin* UntouchedSkins::Find(const KnownLoads& loads) {
  KnownLoads at = loads;
  if (specific_force_step_mps2_ == 0) at.specific_force_mps2.setZero();
  if (!(std::abs(at.pressure_mpa) < (kMostInflationSteps - 1) * mechanics_.pressure_step()) ||
      !(at.specific_force_mps2.norm() <= kMostForceSteps * specific_force_step_mps2_))
    return nullptr;
  ++calls_;
  if (const UntouchedSkin* skin = FindAt(at)) return skin;
  return at.pressure_mpa < 0 ? FindUnderLessSuction(at) : nullptr;
}

// At the strongest suction of the grid that the skin stands, by bisection; it stands all weaker ones.
const UntouchedSkin* UntouchedSkins::FindUnderLessSuction(KnownLoads loads) {
  auto fails = static_cast<int>(std::ceil(loads.pressure_mpa / part_mpa_)) - 1;
  int stands = std::min(0, fails + kForgivenSteps * kParts);
  const auto find = [&](int part) {
    loads.pressure_mpa = part * part_mpa_;
    return FindAt(loads);
  };
  if (find(stands) == nullptr) return nullptr;
  while (stands - fails > 1) {
    const int middle = fails + (stands - fails) / 2;
    (find(middle) != nullptr ? stands : fails) = middle;
  }
  return find(stands);
}

const UntouchedSkin* UntouchedSkins::FindAt(const KnownLoads& loads) {
  for (Answer& recent : recent_) {
    if (recent.used == 0 || recent.skin.loads != loads) continue;
    recent.used = calls_;
    return recent.is_found ? &recent.skin : nullptr;
  }
  GridPoint point = {static_cast<int>(std::round(loads.pressure_mpa / part_mpa_)), 0, 0, 0};
  for (size_t k = 1; k < point.size() && specific_force_step_mps2_ > 0; ++k)
    point[k] = static_cast<int>(
        std::round(loads.specific_force_mps2[static_cast<Eigen::Index>(k) - 1] / specific_force_step_mps2_));
  const Inflation base = Base(loads.pressure_mpa);
  if (!base) return nullptr;
  const Answer* near = Expanded(point);
  if (near == nullptr || !near->is_found) return nullptr;
  Answer& found = *std::ranges::min_element(recent_, {}, &Answer::used);
  found.used = calls_;
  UntouchedSkin& skin = found.skin;
  skin.loads = loads;
  skin.state = near->skin.state;
  found.motion = near->motion;
  found.stability = near->stability;
  const Vec4 more = loads.Stacked() - near->skin.loads.Stacked();
  mechanics_.shell().Step(found.motion.cast<double>() * more, skin.state);
  // Under suction the inflated skin, too, may be about to buckle.
  const bool is_surely_stable = loads.pressure_mpa >= 0 && found.stability > kSurelyStable;
  found.is_found = Solve(*base, loads, skin.state) && (is_surely_stable || WriteStability(*base, found)) &&
                   WriteDerivatives(base, found);
  return found.is_found ? &skin : nullptr;
}

// Returns nullptr if no inflated skin is stable at that pressure.
const UntouchedSkins::Answer* UntouchedSkins::Expanded(const GridPoint& point) {
  if (const auto found = expansions_.find(point); found != expansions_.end()) {
    found->second.used = calls_;
    return &found->second;
  }
  const Inflation base = Inflated(point[0]);
  // Where the skin does not stand at the nearest pressure of the grid, it may at the one before.
  if (!base && point[0] < 0) return Expanded({point[0] + 1, point[1], point[2], point[3]});
  if (!base) return nullptr;
  if (expansions_.size() >= kMostExpansions) EraseOldest(expansions_);
  Answer made;
  made.used = calls_;
  made.skin.loads = {point[0] * part_mpa_, specific_force_step_mps2_ * Vec3(point[1], point[2], point[3])};
  made.skin.state = base->state;
  made.motion.setZero(mechanics_.shell().dof_count(), KnownLoads::kCount);
  made.is_found = Solve(*base, made.skin.loads, made.skin.state) && WriteStability(*base, made) &&
                  WriteDerivatives(base, made);
  return &expansions_.emplace(point, std::move(made)).first->second;
}

// From `state` nearby.
bool UntouchedSkins::Solve(const InflatedSkin& base, const KnownLoads& loads, ShellState& state) {
  const PressureLoads pressure(loads.pressure_mpa);
  return equilibrium_.Solve(base.stiffness, pressure.loads(), mechanics_.Weight(loads), state).converged &&
         IsClearOfTube(state);
}

bool UntouchedSkins::IsClearOfTube(const ShellState& state) const {
  const LinkModel& model = mechanics_.model();
  const double least_mm = model.tube_outer_radius_mm + model.thickness_mm / 2;
  return model.tube_outer_radius_mm == 0 || std::ranges::all_of(state.mids_mm, [least_mm](const Vec3& mid) {
           return mid.head<2>().norm() > least_mm;
         });
}

// False: the equilibrium is not stable.
bool UntouchedSkins::WriteStability(const InflatedSkin& base, Answer& answer) {
  const PressureLoads pressure(answer.skin.loads.pressure_mpa);
  answer.stability = equilibrium_.Stability(base.stiffness, pressure.loads(), answer.skin.state);
  return answer.stability > 0;
}

// Completes the skin at its state; `motion` is first an estimate. False: see RingEquilibrium::Response.
bool UntouchedSkins::WriteDerivatives(const Inflation& base, Answer& answer) {
  UntouchedSkin& skin = answer.skin;
  const MarkerMap& map = mechanics_.markers();
  map.Displacements(skin.state, skin.markers_mm);
  map.WriteJacobian(mechanics_.shell(), skin.state, jacobian_);
  mechanics_.GradientByLoads(skin.state, gradient_);
  const PressureLoads pressure(skin.loads.pressure_mpa);
  motion_ = answer.motion.cast<double>();
  const double tolerance = kResponseTolerance * std::min(1.0, answer.stability);
  if (!equilibrium_.Response(base->stiffness, pressure.loads(), skin.state, -gradient_, tolerance, motion_))
    return false;
  answer.motion = motion_.cast<float>();
  by_base_.setZero(motion_.rows(), KnownLoads::kCount);
  Eigen::VectorXd moved;
  for (int k = 0; k < KnownLoads::kCount; ++k) {
    if (gradient_.col(k).isZero(0)) continue;
    base->stiffness.Solve(-gradient_.col(k), moved);
    by_base_.col(k) = moved;
  }
  skin.markers_by_loads = jacobian_ * motion_;
  const ByKnownLoads off = skin.markers_by_loads - jacobian_ * by_base_;
  const bool is_stiff_as_base =
      (off.colwise().norm().array() <= kAboutAsStiff * skin.markers_by_loads.colwise().norm().array()).all();
  skin.weightless = base;
  skin.is_stiff_as_weightless = is_stiff_as_base;
  return true;
}

}  // namespace taclink
