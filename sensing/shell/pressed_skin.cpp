#include "sensing/shell/pressed_skin.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

namespace taclink {
namespace {

constexpr double kTolerance = 1e-7;  // of E t^2
constexpr double kMostSteps = 1000;  // of one motion; who asks for more has the wrong unit

PressSummary Refused(EquilibriumStop stop) {
  PressSummary summary;
  summary.stop = stop;
  summary.reached = 0;
  return summary;
}

EquilibriumOptions SolverOptions(const LinkModel& model) {
  EquilibriumOptions options;
  options.tolerance_n =
      kTolerance * model.material.youngs_modulus_mpa * model.thickness_mm * model.thickness_mm;
  return options;
}

RigidContactOptions ContactOptions(const LinkModel& model, const PressedSkinOptions& options, bool sticks) {
  return {.spacing_mm = options.spacing_mm,
          .stiffness_n_mm3 = options.stiffness * model.material.youngs_modulus_mpa / model.thickness_mm,
          .sticks = sticks};
}

double RadiusAtMid(const LinkModel& model) {
  return model.PointAtDepth(0, model.length_mm / 2, model.thickness_mm / 2).head<2>().norm();
}

ShellMesh MeshOf(const LinkModel& model, const PressedSkinOptions& options) {
  ShellMesh mesh = MakeShellMesh(model, options.refinement);
  if (options.refinement_along == 0) return mesh;
  return MakeShellMesh(model, MeshRefinement{mesh.refinement, options.refinement_along});
}

// By how far a specific force across the axis moves the middle of a linear skin: as a beam between its
// clamps, w L^4 / 384 E I, and by shear, w L^2 / 8 k G A with k = 1/2 of a thin tube [timoshenko1921]. Along
// the axis it moves the skin less.
double SagMm(const LinkModel& model, double specific_force_mps2) {
  const double length2 = model.length_mm * model.length_mm, radius = RadiusAtMid(model);
  const double force_n_per_mm2 = model.MassPerArea() * specific_force_mps2;
  return force_n_per_mm2 * length2 / (model.material.youngs_modulus_mpa * model.thickness_mm) *
         (length2 / (192 * radius * radius) + 0.75);
}

double LongestMotion(const ShellState& from, const ShellState& to) {
  double longest = 0;
  for (size_t i = 0; i < from.mids_mm.size(); ++i) {
    longest = std::max(longest, (to.mids_mm[i] - from.mids_mm[i]).norm());
  }
  return longest;
}

}  // namespace

std::string PressSummary::Text() const {
  if (ok()) {
    std::string text = "converged in " + std::to_string(steps) + " steps";
    char snap[64];
    std::snprintf(snap, sizeof snap, ", snapped %d time%s, by up to %.2g mm", snaps, snaps == 1 ? "" : "s",
                  snapped_mm);
    return snaps > 0 ? text + snap : text;
  }
  return "stopped at " + std::to_string(static_cast<int>(100 * reached)) + " % of the way: " + Name(stop);
}

PressedSkin::PressedSkin(const LinkModel& model, const PressedSkinOptions& options)
    : model_(model),
      options_(options),
      mesh_(MeshOf(model, options)),
      markers_(model, mesh_),
      shell_(SkinSurface(mesh_), model.material),
      solver_(shell_, SolverOptions(model)),
      pressure_(0),
      corner_areas_mm2_(CornerAreas(shell_.surface())),
      body_force_(corner_areas_mm2_, Vec3::Zero()),
      state_(shell_.Rest()) {
  if (model.tube_outer_radius_mm > 0) {
    tube_ = std::make_unique<RigidContact>(shell_, ContactOptions(model, options, false));
    tube_->SetBody(RigidBar{Vec3::Zero(), Vec3::UnitZ(), model.tube_outer_radius_mm});
  }
}

int PressedSkin::AddBody(const RigidBody& body, bool sticks) {
  bodies_.emplace_back(shell_, ContactOptions(model_, options_, sticks));
  bodies_.back().SetBody(body);
  return static_cast<int>(bodies_.size()) - 1;
}

void PressedSkin::RemoveBodies(const ShellState& untouched) {
  bodies_.clear();
  state_ = untouched;
}

RigidContact::Summary PressedSkin::TubeContact() const {
  return tube_ ? tube_->Summarize(state_) : RigidContact::Summary{};
}

Vec3 PressedSkin::Marker(int marker) const {
  return markers_.Position(state_.mids_mm, state_.directors, marker);
}

void PressedSkin::Apply(const KnownLoads& loads) {
  known_loads_ = loads;
  pressure_ = FollowerPressure(loads.pressure_mpa);
  body_force_ = BodyForce(corner_areas_mm2_, model_.MassPerArea() * loads.specific_force_mps2);
}

EquilibriumSummary PressedSkin::Settle(ShellState& state) {
  std::vector<const ElementLoad*> loads = {&pressure_};
  if (!known_loads_.specific_force_mps2.isZero(0)) loads.push_back(&body_force_);
  if (tube_) loads.push_back(tube_.get());
  for (const RigidContact& body : bodies_) loads.push_back(&body);
  return solver_.Solve(loads, {}, state);
}

ShellState PressedSkin::Extrapolated(const Point& before, const Point& last, double at) {
  const double share = (at - last.at) / (last.at - before.at);
  ShellState guess = last.state;
  for (size_t i = 0; i < guess.mids_mm.size(); ++i) {
    guess.mids_mm[i] += share * (last.state.mids_mm[i] - before.state.mids_mm[i]);
    Vec3& d = guess.directors[i];
    Vec3& t = guess.tangents[i];
    d = (d + share * (d - before.state.directors[i])).normalized();
    t = (t - t.dot(d) * d).normalized();
  }
  return guess;
}

// `advance` sets the loads for a share of the way, on all of which a node moves by `usual_mm` or so. Steps
// grow where they are easy and halve where they fail, or where the skin moves far over states that are not
// stable.
template <typename Advance>
PressSummary PressedSkin::Follow(double longest, double least, double usual_mm, Advance advance) {
  constexpr int kEasy = 6, kMostSettlings = 4;
  constexpr double kFar = 1.5, kLittle = 0.01;  // times usual, and of the thickness
  PressSummary summary;
  Point last{0, state_};
  std::optional<Point> before;
  double step = longest;
  while (last.at < 1) {
    const double at = last.at + step > 1 - 1e-9 ? 1 : last.at + step;
    advance(at);
    ShellState guess = before ? Extrapolated(*before, last, at) : last.state;
    std::vector<RigidContact::Grip> grips;
    for (const RigidContact& body : bodies_) grips.push_back(body.GripNow());
    EquilibriumSummary settled;
    int iterations = 0, shifted = 0;
    for (int settling = 0; settling < kMostSettlings; ++settling) {
      settled = Settle(guess);
      iterations += settled.iterations;
      shifted += settled.shifted;
      if (!settled.ok()) break;
      bool let_go = false;
      for (RigidContact& body : bodies_) let_go = body.Hold(guess) || let_go;
      if (!let_go) break;
    }
    summary.iterations += iterations;
    summary.shifted += shifted;
    const double moved_mm = settled.ok() ? LongestMotion(last.state, guess) : 0;
    const bool snapped =
        shifted > 0 && moved_mm > kFar * usual_mm * (at - last.at) + kLittle * model_.thickness_mm;
    if (!settled.ok() || (snapped && step / 2 >= least)) {
      for (size_t i = 0; i < bodies_.size(); ++i) bodies_[i].Restore(grips[i]);
      step /= 2;
      if (step >= least) continue;
      advance(last.at);
      summary.stop = settled.stop;
      summary.residual_n = settled.residual_n;
      summary.reached = last.at;
      break;
    }
    ++summary.steps;
    summary.residual_n = settled.residual_n;
    summary.stable = settled.stable;
    if (snapped) {
      ++summary.snaps;
      summary.snapped_mm = std::max(summary.snapped_mm, moved_mm);
    }
    before = snapped ? std::nullopt : std::optional(std::move(last));
    last = {at, std::move(guess)};
    if (iterations <= kEasy) step = std::min(longest, 1.5 * step);
  }
  state_ = std::move(last.state);
  return summary;
}

double PressureScale(const LinkModel& model) {
  return model.material.youngs_modulus_mpa * model.thickness_mm / RadiusAtMid(model);
}

PressSummary PressedSkin::Load(const KnownLoads& loads) {
  if (!loads.Stacked().allFinite()) return Refused(EquilibriumStop::kNotFinite);
  const KnownLoads from = known_loads_;
  const double change = loads.pressure_mpa - from.pressure_mpa;
  const Vec3 turn = loads.specific_force_mps2 - from.specific_force_mps2;
  const double sag_mm = SagMm(model_, turn.norm());
  if (change == 0 && sag_mm == 0) {
    Apply(loads);
    return {};
  }
  const double step = options_.pressure_step * PressureScale(model_), radius = RadiusAtMid(model_);
  double longest = 1;
  if (change != 0) longest = std::min(longest, step / std::abs(change));
  if (sag_mm > 0) longest = std::min(longest, options_.pressure_step * radius / sag_mm);
  if (longest * kMostSteps < 1) return Refused(EquilibriumStop::kMaxIterations);
  // A linear skin's growth, the radius times the pressure over its scale, and its sag.
  const double usual_mm = radius * std::abs(change) / PressureScale(model_) + sag_mm;
  return Follow(longest, longest / 256, usual_mm, [&](double at) {
    Apply({from.pressure_mpa + at * change, from.specific_force_mps2 + at * turn});
  });
}

PressSummary PressedSkin::Move(std::span<const Vec3> by_mm) {
  double distance = 0;
  for (const Vec3& by : by_mm) {
    if (!by.allFinite()) return Refused(EquilibriumStop::kNotFinite);
    distance = std::max(distance, by.norm());
  }
  if (distance == 0) return {};
  if (distance > kMostSteps * options_.step_mm) return Refused(EquilibriumStop::kMaxIterations);
  std::vector<RigidBody> from;
  from.reserve(bodies_.size());
  for (const RigidContact& body : bodies_) from.push_back(body.body());
  return Follow(std::min(1.0, options_.step_mm / distance), options_.least_step_mm / distance, distance,
                [&](double at) {
                  for (size_t i = 0; i < by_mm.size(); ++i) bodies_[i].SetBody(Moved(from[i], at * by_mm[i]));
                });
}

}  // namespace taclink
