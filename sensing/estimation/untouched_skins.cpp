#include "sensing/estimation/untouched_skins.h"

#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

constexpr int kParts = 4;  // of SkinMechanics::pressure_step: the grid of pressures
constexpr int kMostInflationSteps = 400, kMostForceSteps = 120;
constexpr double kToleranceMm = 1e-4, kLongestStepMm = 8;  // in length units
constexpr int kForgivenSteps = 2;   // that a pressure may be beyond what the skin stands
constexpr double kSagStepMm = 0.5;  // in length units: by which a step of specific force moves the slack skin
constexpr size_t kMostInflated = 24, kMostExpansions = 32;  // that are kept, some 0.15 MB each
// Largest relative difference between the marker derivatives by known loads of the skin with its weight and
// of the inflated skin, up to which the latter's stiffness is taken for both. Contact loads then differ by
// less than half of it, as they do between tangents 0.4 mm of inflation apart.
constexpr double kAboutAsStiff = 0.25;
constexpr std::array<int, 2> kSteps = {4, 16};  // of a way that RingEquilibrium does not find

EquilibriumOptions SolverOptions(const LinkModel& model) {
  EquilibriumOptions options;
  options.tolerance_n = 1e-7 * model.material.youngs_modulus_mpa * model.thickness_mm * model.thickness_mm;
  return options;
}

template <typename Map>
void EraseOldest(Map& map) {
  map.erase(std::ranges::min_element(map, {}, [](const auto& each) { return each.second.used; }));
}

}  // namespace

// The pressure alone; weight is a dead load.
class UntouchedSkins::Pressure {
 public:
  explicit Pressure(const KnownLoads& loads) : pressure_(loads.pressure_mpa) {
    if (loads.pressure_mpa != 0) loads_ = {&one_, 1};
  }
  Pressure(const Pressure&) = delete;
  Pressure& operator=(const Pressure&) = delete;
  NonlinearShell::Loads loads() const { return loads_; }

 private:
  FollowerPressure pressure_;
  const ElementLoad* one_ = &pressure_;
  NonlinearShell::Loads loads_;
};

UntouchedSkins::UntouchedSkins(const SkinMechanics& mechanics)
    : mechanics_(mechanics),
      part_mpa_(mechanics.pressure_step() / kParts),
      is_round_(RingBlocks::Fit(mechanics.shell())),
      equilibrium_(mechanics.shell(), {.tolerance_mm = kToleranceMm * mechanics.length_unit(),
                                       .longest_step_mm = kLongestStepMm * mechanics.length_unit()}),
      jacobian_(mechanics.markers().MakeJacobian(mechanics.shell())) {
  if (mechanics.mass_per_area() == 0) return;
  const Expansion* slack = Expanded({});
  if (slack == nullptr || slack->way == Way::kNone) return;  // nor is there one under any load
  const double mm_per_mps2 = slack->skin.markers_by_loads.rightCols<3>().cwiseAbs().maxCoeff();
  specific_force_step_mps2_ = kSagStepMm * mechanics.length_unit() / mm_per_mps2;
}

UntouchedSkins::~UntouchedSkins() = default;

// Null if there is no stable equilibrium. Under suction there is one only if there is one at all smaller
// suctions of the grid.
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
  // Less suction; less pressure does not help a skin that collapses under its weight.
  auto part = static_cast<int>(std::trunc(at.pressure_mpa / part_mpa_));
  if (part * part_mpa_ == at.pressure_mpa) ++part;
  for (int i = 0; at.pressure_mpa < 0 && i <= kForgivenSteps * kParts; ++i, ++part) {
    at.pressure_mpa = part * part_mpa_;
    if (const UntouchedSkin* skin = FindAt(at)) return skin;
  }
  return nullptr;
}

const UntouchedSkin* UntouchedSkins::FindAt(const KnownLoads& loads) {
  for (Recent& recent : recent_) {
    if (recent.used == 0 || recent.skin.loads != loads) continue;
    recent.used = calls_;
    return &recent.skin;
  }
  GridPoint point = {static_cast<int>(std::round(loads.pressure_mpa / part_mpa_)), 0, 0, 0};
  for (size_t k = 1; k < point.size() && specific_force_step_mps2_ > 0; ++k)
    point[k] = static_cast<int>(
        std::round(loads.specific_force_mps2[static_cast<Eigen::Index>(k) - 1] / specific_force_step_mps2_));
  const Inflation base = Base(loads.pressure_mpa);
  if (!base) return nullptr;
  const Expansion* near = Expanded(point);
  if (near == nullptr || near->way == Way::kNone) return nullptr;
  Recent& found = *std::ranges::min_element(recent_, {}, &Recent::used);
  found.used = 0;
  UntouchedSkin& skin = found.skin;
  skin.loads = loads;
  if (!SolveNear(*near, *base, loads, skin.state)) return nullptr;
  motion_ = near->motion;
  if (!WriteDerivatives(base, near->way, skin, motion_)) return nullptr;
  found.used = calls_;
  return &skin;
}

// Null if there is no inflated skin at that pressure.
const UntouchedSkins::Expansion* UntouchedSkins::Expanded(const GridPoint& point) {
  if (const auto found = expansions_.find(point); found != expansions_.end()) {
    found->second.used = calls_;
    return &found->second;
  }
  const Inflation from = Inflated(point[0]);
  // Where the skin does not stand at the nearest pressure of the grid, it may at the one before.
  if (!from && point[0] < 0) return Expanded({point[0] + 1, point[1], point[2], point[3]});
  if (!from) return nullptr;
  if (expansions_.size() >= kMostExpansions) EraseOldest(expansions_);
  Expansion made;
  made.used = calls_;
  made.skin.loads = {point[0] * part_mpa_, specific_force_step_mps2_ * Vec3(point[1], point[2], point[3])};
  made.skin.state = from->state;
  made.way = SolveFromBase(*from, made.skin.loads, made.skin.state);
  made.motion.setZero(mechanics_.shell().dof_count(), KnownLoads::kCount);
  if (made.way != Way::kNone &&
      !(WriteDerivatives(from, made.way, made.skin, made.motion) &&
        equilibrium_.IsStable(from->stiffness, Pressure(made.skin.loads).loads(), made.skin.state)))
    made.way = Way::kNone;
  return &expansions_.emplace(point, std::move(made)).first->second;
}

UntouchedSkins::Way UntouchedSkins::SolveFromBase(const InflatedSkin& base, const KnownLoads& loads,
                                                  ShellState& state) {
  const Pressure pressure(loads);
  state = base.state;
  if (equilibrium_.Solve(base.stiffness, pressure.loads(), mechanics_.Weight(loads), state).converged)
    return Way::kFromBase;
  for (const int steps : kSteps) {
    if (SolveBySteps(base.state, {loads.pressure_mpa, Vec3::Zero()}, steps, loads, state))
      return Way::kInSteps;
  }
  return Way::kNone;
}

bool UntouchedSkins::SolveNear(const Expansion& near, const InflatedSkin& base, const KnownLoads& loads,
                               ShellState& state) {
  ShellState from = near.skin.state;
  mechanics_.shell().Step(near.motion * (loads.Stacked() - near.skin.loads.Stacked()), from);
  if (near.way == Way::kFromBase) {
    const Pressure pressure(loads);
    state = from;
    if (equilibrium_.Solve(base.stiffness, pressure.loads(), mechanics_.Weight(loads), state).converged)
      return true;
  }
  return SolveBySteps(from, loads, 1, loads, state) ||
         SolveBySteps(near.skin.state, near.skin.loads, kSteps.front(), loads, state);
}

bool UntouchedSkins::SolveBySteps(const ShellState& from, const KnownLoads& from_loads, int steps,
                                  const KnownLoads& loads, ShellState& state) {
  if (!in_steps_)
    in_steps_ = std::make_unique<EquilibriumSolver>(mechanics_.shell(), SolverOptions(mechanics_.model()));
  state = from;
  for (int step = 1; step <= steps; ++step) {
    const double share = static_cast<double>(step) / steps;
    const AppliedLoads applied(
        mechanics_, KnownLoads::FromStacked((1 - share) * from_loads.Stacked() + share * loads.Stacked()));
    const EquilibriumSummary summary = in_steps_->Solve(applied.loads(), {}, state);
    if (!summary.ok() || !summary.stable) return false;
  }
  equilibrium_.Forget();
  return true;
}

// Completes `skin` at its state. `motion`: in and out, see RingEquilibrium::Response.
bool UntouchedSkins::WriteDerivatives(const Inflation& base, Way way, UntouchedSkin& skin,
                                      ByKnownLoads& motion) {
  const MarkerMap& map = mechanics_.markers();
  map.Displacements(skin.state, skin.markers_mm);
  map.WriteJacobian(mechanics_.shell(), skin.state, jacobian_);
  mechanics_.GradientByLoads(skin.state, gradient_);
  const Pressure pressure(skin.loads);
  Eigen::VectorXd moved, moved_by_base;
  by_base_.setZero(motion.rows(), KnownLoads::kCount);
  for (int k = 0; k < KnownLoads::kCount; ++k) {
    if (gradient_.col(k).isZero(0)) continue;
    moved = motion.col(k);
    if (!equilibrium_.Response(base->stiffness, pressure.loads(), skin.state, -gradient_.col(k), moved))
      return false;
    motion.col(k) = moved;
    base->stiffness.Solve(-gradient_.col(k), moved_by_base);
    by_base_.col(k) = moved_by_base;
  }
  skin.markers_by_loads = jacobian_ * motion;
  const ByKnownLoads off = skin.markers_by_loads - jacobian_ * by_base_;
  const bool is_stiff_as_base =
      (off.colwise().norm().array() <= kAboutAsStiff * skin.markers_by_loads.colwise().norm().array()).all();
  skin.inflated = way == Way::kFromBase && is_stiff_as_base ? base : nullptr;
  return true;
}

}  // namespace taclink
