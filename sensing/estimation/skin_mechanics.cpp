#include "sensing/estimation/skin_mechanics.h"

#include <algorithm>
#include <cmath>

#include "sensing/core/similar_skin.h"
#include "sensing/shell/pressed_skin.h"
#include "sensing/shell/sparse_cholesky.h"

namespace taclink {
namespace {

// Elements must follow a dent, which decays over sqrt(R t): 0.8 of it along the axis; around, 15 degrees.
constexpr double kLongestElement = 0.8, kWidestElementDeg = 15;
// Standard deviation of a load's spread. Narrower, dents that no camera sees come out up to a fifth too deep,
// on these elements; wider, forces of bodies smaller than 5 mm do.
constexpr double kLoadSpreadMm = 3.8;
constexpr double kLeastShare = 0.02;      // of the largest; less is left out of a spread
constexpr double kInflationStep = 0.011;  // of PressureScale
constexpr int kMostInflationSteps = 400;
constexpr int kParts = 8;          // of a step, where the skin does not stand at its far end
constexpr int kForgivenSteps = 2;  // that a pressure may be beyond what the skin stands
constexpr double kSagStepMm = 1;   // in length units: by which a step of specific force moves the slack skin
constexpr int kMostForceSteps = 60;
constexpr size_t kMostSolved = 96;  // equilibria that are kept, some 0.3 MB each

MeshRefinement RefinementFor(const LinkModel& model) {
  const double longest = kLongestElement * DecayLengthMm(model);
  double widest_interval = model.markers.rings_z_mm.front();
  for (size_t i = 1; i < model.markers.rings_z_mm.size(); ++i)
    widest_interval =
        std::max(widest_interval, model.markers.rings_z_mm[i] - model.markers.rings_z_mm[i - 1]);
  widest_interval = std::max(widest_interval, model.length_mm - model.markers.rings_z_mm.back());
  const auto parts = [](double share) { return std::max(1, static_cast<int>(std::ceil(share - 1e-9))); };
  return {parts(DegFromRad(model.markers.path_pitch_rad()) / kWidestElementDeg),
          parts(widest_interval / longest)};
}

EquilibriumOptions SolverOptions(const LinkModel& model) {
  EquilibriumOptions options;
  options.tolerance_n = 1e-7 * model.material.youngs_modulus_mpa * model.thickness_mm * model.thickness_mm;
  return options;
}

}  // namespace

SkinMechanics::SkinMechanics(const LinkModel& model, int refinement)
    : model_(model),
      mesh_(refinement > 0 ? MakeShellMesh(model, refinement) : MakeShellMesh(model, RefinementFor(model))),
      shell_(SkinSurface(mesh_), model.material),
      markers_(model, mesh_),
      length_unit_(LengthUnit(model)),
      force_unit_(ForceUnit(model)),
      pressure_step_mpa_(kInflationStep * PressureScale(model)),
      equilibrium_(shell_, SolverOptions(model)) {
  MakeSpread();
  SetUpWeight();
}

bool SkinMechanics::IsBeyondMarkers(int site) const {
  const double z = RestSite(site).z();
  const auto& rings = model_.markers.rings_z_mm;
  const double margin = 0.12 * (rings[1] - rings[0]);
  return z < rings.front() + margin || z > rings.back() - margin;
}

double SkinMechanics::DistanceToClamp(int site) const {
  const double z = RestSite(site).z();
  return std::min(z, model_.length_mm - z);
}

void SkinMechanics::MakeSpread() {
  const double width = kLoadSpreadMm * length_unit_;
  std::vector<Eigen::Triplet<double>> entries;
  for (int to = 0; to < site_count(); ++to) {
    double sum = 0, largest = 0;
    std::vector<std::pair<int, double>> shares;
    for (int site = 0; site < site_count(); ++site) {
      const double off2 = (RestSite(site) - RestSite(to)).squaredNorm();
      if (off2 > 25 * width * width) continue;
      const double share =
          std::exp(-off2 / (2 * width * width)) * mesh_.areas_mm2[static_cast<size_t>(NodeOfSite(site))];
      shares.emplace_back(site, share);
      largest = std::max(largest, share);
    }
    std::erase_if(shares, [&](const auto& s) { return s.second < kLeastShare * largest; });
    for (const auto& s : shares) sum += s.second;
    for (const auto& [site, share] : shares) entries.emplace_back(site, to, share / sum);
  }
  spread_.resize(site_count(), site_count());
  spread_.setFromTriplets(entries.begin(), entries.end());
  spread_.makeCompressed();
}

// Finds the weight's gradient and the grid's step of specific force: by how far it moves the slack skin.
void SkinMechanics::SetUpWeight() {
  gradient_by_specific_force_.setZero(shell_.dof_count(), KnownLoads::kCount);
  mass_per_area_ = model_.MassPerArea();
  if (mass_per_area_ == 0) return;
  corner_areas_mm2_ = CornerAreas(shell_.surface());
  Eigen::VectorXd with, without;
  shell_.Gradient(shell_.Rest(), {}, without);
  for (int axis = 0; axis < 3; ++axis) {
    const BodyForce unit(corner_areas_mm2_, mass_per_area_ * Vec3::Unit(axis));
    const ElementLoad* one[] = {&unit};
    shell_.Gradient(shell_.Rest(), one, with);
    gradient_by_specific_force_.col(1 + axis) = with - without;
  }
  const Equilibrium* slack = Solved({});
  const double mm_per_mps2 = slack->markers_by_loads.rightCols<3>().cwiseAbs().maxCoeff();
  specific_force_step_mps2_ = kSagStepMm * length_unit_ / mm_per_mps2;
}

void SkinMechanics::GradientByLoads(const ShellState& state, ByKnownLoads& out) const {
  const FollowerPressure unit(1);
  const ElementLoad* one[] = {&unit};
  Eigen::VectorXd with, without;
  shell_.Gradient(state, one, with);
  shell_.Gradient(state, {}, without);
  out = gradient_by_specific_force_;
  out.col(0) = with - without;
}

// From `skin.state` to the equilibrium at its loads, with derivatives.
bool SkinMechanics::Solve(Equilibrium& skin) {
  const AppliedLoads applied(*this, skin.loads);
  const EquilibriumSummary summary = equilibrium_.Solve(applied.loads(), {}, skin.state);
  if (!summary.ok() || !summary.stable) return false;
  Eigen::SparseMatrix<double> hessian = shell_.Pattern();
  SparseCholesky factor(hessian);
  Eigen::VectorXd gradient, moved;
  shell_.Hessian(skin.state, applied.loads(), gradient, hessian);
  if (!factor.Factorise(hessian)) return false;
  ByKnownLoads motion;
  GradientByLoads(skin.state, motion);
  for (int k = 0; k < KnownLoads::kCount; ++k) {
    if (motion.col(k).isZero(0)) continue;
    factor.Solve(-motion.col(k), moved);
    motion.col(k) = moved;
  }
  markers_.Displacements(skin.state, skin.markers_mm);
  MarkerMap::Jacobian jacobian = markers_.MakeJacobian(shell_);
  markers_.WriteJacobian(shell_, skin.state, jacobian);
  skin.markers_by_loads = jacobian * motion;
  const size_t nodes = skin.state.mids_mm.size();
  skin.mids_by_loads.assign(nodes, Equilibrium::NodeByLoads::Zero());
  skin.directors_by_loads.assign(nodes, Equilibrium::NodeByLoads::Zero());
  for (size_t i = 0; i < nodes; ++i) {
    const int dof = shell_.Dof(static_cast<int>(i), 0);
    if (dof < 0) continue;
    const Vec3& d = skin.state.directors[i];
    const Vec3& t = skin.state.tangents[i];
    skin.mids_by_loads[i] = motion.middleRows<3>(dof);
    skin.directors_by_loads[i] = t.cross(d) * motion.row(dof + 3) + d.cross(t).cross(d) * motion.row(dof + 4);
  }
  return true;
}

// Where the way to a grid point comes from: from half the specific force under the same pressure, and without
// that whole steps of pressure from the step before, parts of a step from its near end.
SkinMechanics::GridPoint SkinMechanics::Before(const GridPoint& point) {
  GridPoint before = point;
  if (std::any_of(point.begin() + 1, point.end(), [](int steps) { return steps != 0; })) {
    for (size_t k = 1; k < before.size(); ++k) before[k] /= 2;
    return before;
  }
  const int nearer = point[0] > 0 ? point[0] - 1 : point[0] + 1;
  before[0] = nearer / kParts * kParts;
  return before;
}

const SkinMechanics::Equilibrium* SkinMechanics::Solved(const GridPoint& point) {
  if (const auto found = solved_.find(point); found != solved_.end()) return found->second.get();
  auto skin = std::make_unique<Equilibrium>();
  skin->loads.pressure_mpa = point[0] * (pressure_step_mpa_ / kParts);
  skin->loads.specific_force_mps2 = specific_force_step_mps2_ * Vec3(point[1], point[2], point[3]);
  if (point == GridPoint{}) {
    skin->state = shell_.Rest();
  } else {
    const Equilibrium* before = Solved(Before(point));
    if (before == nullptr) return solved_.emplace(point, nullptr).first->second.get();
    skin->state = before->state;
  }
  if (!Solve(*skin)) skin = nullptr;
  return solved_.emplace(point, std::move(skin)).first->second.get();
}

const UntouchedSkin* SkinMechanics::Untouched(const KnownLoads& loads) {
  KnownLoads at = loads;
  if (mass_per_area_ == 0) at.specific_force_mps2.setZero();
  if (!(std::abs(at.pressure_mpa) < (kMostInflationSteps - 1) * pressure_step_mpa_) ||
      !(at.specific_force_mps2.norm() <= kMostForceSteps * specific_force_step_mps2_))
    return nullptr;
  if (solved_.size() > kMostSolved) solved_.clear();
  for (const int parts : {kParts, 1}) {
    if (const UntouchedSkin* skin = Between(at, parts)) return skin;
  }
  const double part_mpa = pressure_step_mpa_ / kParts;
  const int toward = at.pressure_mpa > 0 ? -1 : 1;
  auto part = static_cast<int>(std::trunc(at.pressure_mpa / part_mpa));
  for (int i = 0; i <= kForgivenSteps * kParts; ++i, part += toward) {
    at.pressure_mpa = part * part_mpa;
    if (const UntouchedSkin* skin = Between(at, 1)) return skin;
  }
  return nullptr;
}

// Of the simplex of grid points that the loads lie in: from the lowest corner of the cell along its edges,
// the largest remainder first (Kuhn's triangulation [kuhn1960]). Pressures are multiples of `parts` of a
// step.
const UntouchedSkin* SkinMechanics::Between(const KnownLoads& loads, int parts) {
  constexpr double kNone = 1e-9;
  Vec4 at = loads.Stacked();
  at[0] /= pressure_step_mpa_ * parts / kParts;
  if (mass_per_area_ > 0) at.tail<3>() /= specific_force_step_mps2_;
  GridPoint point;
  std::array<std::pair<double, size_t>, KnownLoads::kCount> rest;
  for (size_t k = 0; k < point.size(); ++k) {
    const double steps = at[static_cast<Eigen::Index>(k)], low = std::floor(steps + kNone);
    point[k] = static_cast<int>(low) * (k == 0 ? parts : 1);
    rest[k] = {std::max(0.0, steps - low), k};
  }
  std::sort(rest.rbegin(), rest.rend());
  std::array<Corner, KnownLoads::kCount + 1> corners;
  size_t count = 0;
  double left = 1;
  for (size_t k = 0; k <= rest.size(); ++k) {
    const double next = k < rest.size() ? rest[k].first : 0, share = left - next;
    if (share > kNone) {
      const Equilibrium* skin = Solved(point);
      if (skin == nullptr) return nullptr;
      corners[count++] = {skin, share};
    }
    if (k == rest.size()) break;
    left = next;
    point[rest[k].second] += rest[k].second == 0 ? parts : 1;
  }
  if (count == 1) return corners.front().skin;
  return Blend(loads, std::span(corners).first(count));
}

// Of expansions f_i + D_i (x - x_i) / 2 about corners with barycentric shares s_i: with f quadratic and
// e_i = x_i - x, each is f(x) + D(x) e_i / 2, and the e_i sum to none [guessab2006].
const UntouchedSkin* SkinMechanics::Blend(const KnownLoads& loads, std::span<const Corner> corners) {
  const size_t nodes = corners.front().skin->state.mids_mm.size();
  if (between_.loads == loads && between_.state.mids_mm.size() == nodes) return &between_;
  between_.loads = loads;
  between_.markers_mm.setZero(corners.front().skin->markers_mm.size());
  between_.markers_by_loads.setZero(between_.markers_mm.size(), KnownLoads::kCount);
  between_.state.mids_mm.assign(nodes, Vec3::Zero());
  between_.state.directors.assign(nodes, Vec3::Zero());
  between_.state.tangents.assign(nodes, Vec3::Zero());
  for (const auto& [skin, share] : corners) {
    const Vec4 half = 0.5 * (loads.Stacked() - skin->loads.Stacked());
    between_.markers_mm += share * (skin->markers_mm + skin->markers_by_loads * half);
    between_.markers_by_loads += share * skin->markers_by_loads;
    for (size_t i = 0; i < nodes; ++i) {
      between_.state.mids_mm[i] += share * (skin->state.mids_mm[i] + skin->mids_by_loads[i] * half);
      between_.state.directors[i] += share * (skin->state.directors[i] + skin->directors_by_loads[i] * half);
      between_.state.tangents[i] += share * skin->state.tangents[i];
    }
  }
  for (size_t i = 0; i < nodes; ++i) {
    Vec3& d = between_.state.directors[i];
    Vec3& t = between_.state.tangents[i];
    d.normalize();
    t = (t - t.dot(d) * d).normalized();
  }
  return &between_;
}

AppliedLoads::AppliedLoads(const SkinMechanics& mechanics, const KnownLoads& loads)
    : pressure_(loads.pressure_mpa),
      body_(mechanics.corner_areas_mm2(), mechanics.mass_per_area() * loads.specific_force_mps2) {
  if (loads.pressure_mpa != 0) all_[count_++] = &pressure_;
  if (mechanics.mass_per_area() > 0 && !loads.specific_force_mps2.isZero(0)) all_[count_++] = &body_;
}

}  // namespace taclink
