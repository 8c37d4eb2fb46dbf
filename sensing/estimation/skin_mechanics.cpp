#include "sensing/estimation/skin_mechanics.h"

#include <algorithm>
#include <cmath>

#include "sensing/core/similar_skin.h"
#include "sensing/shell/element_load.h"
#include "sensing/shell/pressed_skin.h"
#include "sensing/shell/sparse_cholesky.h"

namespace taclink {
namespace {

// Elements must follow a dent, which decays over sqrt(R t): 0.8 of it along the axis; around, 15 degrees.
constexpr double kLongestElement = 0.8, kWidestElementDeg = 15;
constexpr double kSpreadMm = 3.2;         // standard deviation of a load's spread
constexpr double kLeastShare = 0.02;      // of the largest; less is left out of a spread
constexpr double kInflationStep = 0.011;  // of PressureScale
constexpr int kMostInflationSteps = 400;
constexpr int kParts = 8;          // of a step, where the skin does not stand at its far end
constexpr int kForgivenSteps = 2;  // that a pressure may be beyond what the skin stands

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
  const double width = kSpreadMm * length_unit_;
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

// From `skin.state` to the equilibrium at its pressure, with derivatives.
bool SkinMechanics::Solve(InflatedSkin& skin) {
  const FollowerPressure pressure(skin.pressure_mpa), unit(1);
  const ElementLoad* loads[] = {&pressure};
  const ElementLoad* one[] = {&unit};
  const EquilibriumSummary summary = equilibrium_.Solve(loads, {}, skin.state);
  if (!summary.ok() || !summary.stable) return false;
  Eigen::SparseMatrix<double> hessian = shell_.Pattern();
  SparseCholesky factor(hessian);
  Eigen::VectorXd gradient, with, without;
  shell_.Hessian(skin.state, loads, gradient, hessian);
  if (!factor.Factorise(hessian)) return false;
  shell_.Gradient(skin.state, one, with);
  shell_.Gradient(skin.state, {}, without);
  const Eigen::VectorXd motion = factor.Solve(without - with);
  markers_.Displacements(skin.state, skin.markers_mm);
  MarkerMap::Jacobian jacobian = markers_.MakeJacobian(shell_);
  markers_.WriteJacobian(shell_, skin.state, jacobian);
  skin.markers_mm_per_mpa = jacobian * motion;
  const size_t nodes = skin.state.mids_mm.size();
  skin.mids_per_mpa.assign(nodes, Vec3::Zero());
  skin.directors_per_mpa.assign(nodes, Vec3::Zero());
  for (size_t i = 0; i < nodes; ++i) {
    const int dof = shell_.Dof(static_cast<int>(i), 0);
    if (dof < 0) continue;
    const Vec3& d = skin.state.directors[i];
    const Vec3& t = skin.state.tangents[i];
    skin.mids_per_mpa[i] = motion.segment<3>(dof);
    skin.directors_per_mpa[i] = (motion[dof + 3] * t + motion[dof + 4] * d.cross(t)).cross(d);
  }
  return true;
}

// Whole steps are solved from the step before, parts of a step from its near end.
const InflatedSkin* SkinMechanics::Solved(int part) {
  if (std::abs(part) > kMostInflationSteps * kParts) return nullptr;
  if (const auto found = solved_.find(part); found != solved_.end()) return found->second.get();
  auto skin = std::make_unique<InflatedSkin>();
  skin->pressure_mpa = part * (pressure_step_mpa_ / kParts);
  if (part == 0) {
    skin->state = shell_.Rest();
  } else {
    const int nearer = part > 0 ? part - 1 : part + 1;
    const InflatedSkin* before = Solved(nearer / kParts * kParts);
    if (before == nullptr) return solved_.emplace(part, nullptr).first->second.get();
    skin->state = before->state;
  }
  if (!Solve(*skin)) skin = nullptr;
  return solved_.emplace(part, std::move(skin)).first->second.get();
}

const InflatedSkin* SkinMechanics::Inflated(double pressure_mpa) {
  const double part_mpa = pressure_step_mpa_ / kParts;
  if (!(std::abs(pressure_mpa) < (kMostInflationSteps - 1) * pressure_step_mpa_)) return nullptr;
  if (const InflatedSkin* skin = Between(pressure_mpa, kParts)) return skin;
  if (const InflatedSkin* skin = Between(pressure_mpa, 1)) return skin;
  const int toward = pressure_mpa > 0 ? -1 : 1;
  auto part = static_cast<int>(std::trunc(pressure_mpa / part_mpa));
  for (int i = 0; i <= kForgivenSteps * kParts; ++i, part += toward) {
    if (const InflatedSkin* skin = Solved(part)) return skin;
  }
  return nullptr;
}

// Between the multiples of `parts` on both sides.
const InflatedSkin* SkinMechanics::Between(double pressure_mpa, int parts) {
  const double h = pressure_step_mpa_ * parts / kParts, at = pressure_mpa / h;
  const int step = static_cast<int>(std::floor(at));
  const InflatedSkin* a = Solved(step * parts);
  const double x = at - step;
  if (x == 0) return a;
  const InflatedSkin* b = Solved((step + 1) * parts);
  if (a == nullptr || b == nullptr) return nullptr;
  // Hermite's cubic.
  const double rise = x * x * (3 - 2 * x);
  const double slope_a = h * x * (1 - x) * (1 - x), slope_b = h * x * x * (x - 1);
  const auto mix = [&](const Vec3& va, const Vec3& vb, const Vec3& da, const Vec3& db) -> Vec3 {
    return (1 - rise) * va + rise * vb + slope_a * da + slope_b * db;
  };
  between_.pressure_mpa = pressure_mpa;
  between_.markers_mm = (1 - rise) * a->markers_mm + rise * b->markers_mm + slope_a * a->markers_mm_per_mpa +
                        slope_b * b->markers_mm_per_mpa;
  between_.markers_mm_per_mpa = (1 - x) * a->markers_mm_per_mpa + x * b->markers_mm_per_mpa;
  const size_t nodes = a->state.mids_mm.size();
  between_.state.mids_mm.resize(nodes);
  between_.state.directors.resize(nodes);
  between_.state.tangents.resize(nodes);
  for (size_t i = 0; i < nodes; ++i) {
    between_.state.mids_mm[i] =
        mix(a->state.mids_mm[i], b->state.mids_mm[i], a->mids_per_mpa[i], b->mids_per_mpa[i]);
    const Vec3 d =
        mix(a->state.directors[i], b->state.directors[i], a->directors_per_mpa[i], b->directors_per_mpa[i])
            .normalized();
    const Vec3 t = (1 - x) * a->state.tangents[i] + x * b->state.tangents[i];
    between_.state.directors[i] = d;
    between_.state.tangents[i] = (t - t.dot(d) * d).normalized();
  }
  return &between_;
}

}  // namespace taclink
