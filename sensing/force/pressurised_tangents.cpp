#include "sensing/force/pressurised_tangents.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "sensing/mechanics/equilibrium.h"
#include "sensing/mechanics/pressed_skin.h"
#include "sensing/mechanics/sparse_cholesky.h"

namespace taclink {
namespace {

constexpr double kSofteningShare = 0.0164;  // of PressureScale: a pressure that makes the skin much stiffer
// In the coordinate, between known tangents; less under suction, which a skin does not bear for long.
constexpr double kCell = 0.5, kSuctionCell = 0.1;
constexpr double kBlendStep = 0.02;              // likewise, between blends of their compliances
constexpr double kLoneReach = 0.05;              // likewise, for a tangent whose neighbour does not exist
constexpr int kMostIterations = 12;              // to the next equilibrium; a skin that takes more buckles
constexpr int kFirstCell = -20, kLastCell = 10;  // about -0.06 and 1.2 of PressureScale

// Else the skin snapped, or found another shape, at a pressure between them.
bool AreOnOneBranch(const SkinTangent& a, const SkinTangent& b) {
  constexpr double kShare = 0.1, kLittleMm = 0.05;
  const Eigen::VectorXd change = b.offset_mm - a.offset_mm;
  const Eigen::VectorXd told = (b.pressure_mpa - a.pressure_mpa) / 2 * (a.per_pressure + b.per_pressure);
  return (change - told).cwiseAbs().maxCoeff() <= kShare * told.cwiseAbs().maxCoeff() + kLittleMm;
}

}  // namespace

struct PressurisedTangents::Shell {
  Shell(const LinkModel& link, int refinement, const LoadSites& load_sites)
      : model(link),
        sites(load_sites),
        softening_mpa(kSofteningShare * PressureScale(link)),
        mesh(MakeShellMesh(link, refinement)),
        shell(SkinSurface(mesh), link.material),
        solver(shell, {.tolerance_n =
                           1e-7 * link.material.youngs_modulus_mpa * link.thickness_mm * link.thickness_mm,
                       .max_iterations = kMostIterations}),
        hessian(shell.Pattern()),
        factor(hessian) {}

  struct Known {
    SkinTangent tangent;
    ShellState state;
    Eigen::VectorXd by_pressure;  // motion of the shell, mm or rad / MPa
  };

  double PressureOf(int cell) const {
    return softening_mpa * std::sinh((cell < 0 ? kSuctionCell : kCell) * cell);
  }
  bool Inflate(double from_mpa, double to_mpa, ShellState& state);
  bool Compute(Known& known);
  std::unique_ptr<Known> Learn(int cell);
  const Known* Find(int cell);
  void Between(const Known& below, const Known& above, double pressure_mpa);
  void BlendColumns(const Known& below, const Known& above, double share, double coordinate);

  LinkModel model;
  LoadSites sites;
  double softening_mpa;
  ShellMesh mesh;
  NonlinearShell shell;
  EquilibriumSolver solver;
  Eigen::SparseMatrix<double> hessian;
  SparseCholesky factor;
  std::map<int, std::unique_ptr<Known>> known;  // by lower end of a cell; null: no equilibrium

  SkinTangent blended;
  double blended_coordinate = 1e9;
  const Known* nearest = nullptr;
  double asked_mpa = 0;
};

// The tangent at `known.state`.
bool PressurisedTangents::Shell::Compute(Known& fresh) {
  const ShellState& state = fresh.state;
  SkinTangent& tangent = fresh.tangent;
  const FollowerPressure pressure(model.thickness_mm, tangent.pressure_mpa);
  const FollowerPressure unit(model.thickness_mm, 1);
  const ElementLoad* inflating[] = {&pressure};
  const ElementLoad* one[] = {&unit};
  Eigen::VectorXd gradient, with, without;
  shell.Hessian(state, inflating, gradient, hessian);
  if (!factor.Factorise(hessian)) return false;
  MarkerDisplacements(model, mesh, state, tangent.offset_mm);
  // The gradient of the pressure's energy alone: that with it less that without.
  shell.Gradient(state, one, with);
  shell.Gradient(state, {}, without);
  factor.Solve(without - with, fresh.by_pressure);
  MarkerMotions(model, mesh, shell, state, fresh.by_pressure, tangent.per_pressure);
  const std::vector<UnitForce> forces = UnitForces(sites);
  Eigen::MatrixXd loads_n =
      Eigen::MatrixXd::Zero(shell.dof_count(), static_cast<Eigen::Index>(forces.size()));
  for (size_t k = 0; k < forces.size(); ++k) {
    const auto site = static_cast<size_t>(forces[k].site);
    for (const auto& [node, share] : sites.spreads[site]) {
      loads_n.col(static_cast<Eigen::Index>(k)).segment<3>(shell.Dof(node, 0)) +=
          share * sites.frames[site].col(forces[k].direction);
    }
  }
  Eigen::MatrixXd motions;
  factor.Solve(loads_n, motions);
  SizeColumns(model, sites, tangent);
  Eigen::VectorXd answer_mm;
  for (size_t k = 0; k < forces.size(); ++k) {
    MarkerMotions(model, mesh, shell, state, motions.col(static_cast<Eigen::Index>(k)), answer_mm);
    FillColumns(model, sites, forces[k], answer_mm, tangent);
  }
  return true;
}

// In steps no longer than what a skin of this stiffness takes at once.
bool PressurisedTangents::Shell::Inflate(double from_mpa, double to_mpa, ShellState& state) {
  const double longest = kPressureStep * PressureScale(model);
  const int steps = std::max(1, static_cast<int>(std::ceil(std::abs(to_mpa - from_mpa) / longest)));
  for (int i = 1; i <= steps; ++i) {
    const FollowerPressure pressure(model.thickness_mm, from_mpa + (to_mpa - from_mpa) * i / steps);
    const ElementLoad* loads[] = {&pressure};
    const EquilibriumSummary summary = solver.Solve(loads, {}, state);
    if (!summary.ok() || !summary.stable) return false;
  }
  return true;
}

// From its neighbour, to stay on the branch of the skin's states that begins at rest.
std::unique_ptr<PressurisedTangents::Shell::Known> PressurisedTangents::Shell::Learn(int cell) {
  const Known* near = cell == 0 ? nullptr : Find(cell > 0 ? cell - 1 : cell + 1);
  if (cell != 0 && near == nullptr) return nullptr;
  auto fresh = std::make_unique<Known>();
  fresh->tangent.pressure_mpa = PressureOf(cell);
  fresh->state = near != nullptr ? near->state : shell.Rest();
  if (near != nullptr) {
    const double from_mpa = near->tangent.pressure_mpa, change = fresh->tangent.pressure_mpa - from_mpa;
    if (std::abs(change) <= kPressureStep * PressureScale(model)) {
      shell.Step(change * near->by_pressure, fresh->state);  // where it will be, nearly
    }
    if (!Inflate(from_mpa, fresh->tangent.pressure_mpa, fresh->state)) return nullptr;
  }
  if (!Compute(*fresh)) return nullptr;
  if (near != nullptr && !AreOnOneBranch(fresh->tangent, near->tangent)) return nullptr;
  return fresh;
}

const PressurisedTangents::Shell::Known* PressurisedTangents::Shell::Find(int cell) {
  if (cell < kFirstCell || cell > kLastCell) return nullptr;
  const auto found = known.find(cell);
  if (found != known.end()) return found->second.get();
  return known.emplace(cell, Learn(cell)).first->second.get();
}

void PressurisedTangents::Shell::BlendColumns(const Known& below, const Known& above, double share,
                                              double coordinate) {
  if (std::abs(coordinate - blended_coordinate) < kBlendStep) return;
  blended_coordinate = coordinate;
  const auto s = static_cast<float>(share);
  for (const auto columns :
       {&SkinTangent::inward_mm_n, &SkinTangent::around_mm_n, &SkinTangent::along_mm_n}) {
    blended.*columns = (1 - s) * (below.tangent.*columns) + s * (above.tangent.*columns);
  }
}

// By Hermite's cubic for what the pressure alone does.
void PressurisedTangents::Shell::Between(const Known& below, const Known& above, double pressure_mpa) {
  const SkinTangent &a = below.tangent, &b = above.tangent;
  const double width = b.pressure_mpa - a.pressure_mpa;
  const double x = (pressure_mpa - a.pressure_mpa) / width;
  const double rise = x * x * (3 - 2 * x), slope_a = x * (1 - x) * (1 - x), slope_b = x * x * (x - 1);
  blended.pressure_mpa = pressure_mpa;
  blended.offset_mm = (1 - rise) * a.offset_mm + rise * b.offset_mm +
                      width * (slope_a * a.per_pressure + slope_b * b.per_pressure);
  blended.per_pressure = 6 * x * (1 - x) / width * (b.offset_mm - a.offset_mm) +
                         (1 - x) * (1 - 3 * x) * a.per_pressure + x * (3 * x - 2) * b.per_pressure;
  nearest = x < 0.5 ? &below : &above;
}

PressurisedTangents::PressurisedTangents(const LinkModel& model, int refinement, const LoadSites& sites)
    : shell_(std::make_unique<Shell>(model, refinement, sites)) {}
PressurisedTangents::~PressurisedTangents() = default;

double PressurisedTangents::Coordinate(double pressure_mpa) const {
  return std::asinh(pressure_mpa / shell_->softening_mpa);
}

const SkinTangent* PressurisedTangents::At(double pressure_mpa) {
  Shell& s = *shell_;
  s.asked_mpa = pressure_mpa;
  const double coordinate = Coordinate(pressure_mpa);
  if (!std::isfinite(coordinate)) return nullptr;
  const double width = coordinate < 0 ? kSuctionCell : kCell;
  const int cell = static_cast<int>(std::floor(coordinate / width));
  const double share = coordinate / width - cell;
  const auto* below = s.Find(cell);
  const auto* above = share > 0 ? s.Find(cell + 1) : nullptr;
  if (below != nullptr && above != nullptr) {
    s.BlendColumns(*below, *above, share, coordinate);
    s.Between(*below, *above, pressure_mpa);
    return &s.blended;
  }
  const auto* lone = below != nullptr ? below : above;
  if (lone == nullptr || width * (lone == below ? share : 1 - share) > kLoneReach) return nullptr;
  s.nearest = lone;
  return &lone->tangent;
}

ShellState PressurisedTangents::Inflated() const {
  const Shell& s = *shell_;
  ShellState state = s.nearest->state;
  s.shell.Step((s.asked_mpa - s.nearest->tangent.pressure_mpa) * s.nearest->by_pressure, state);
  return state;
}

}  // namespace taclink
