#include "sensing/force/skin_tangent.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <utility>

#include "sensing/mechanics/equilibrium.h"
#include "sensing/mechanics/linear_shell.h"
#include "sensing/mechanics/pressed_skin.h"
#include "sensing/mechanics/sparse_cholesky.h"

namespace taclink {
namespace {

constexpr double kGridMpa = 0.05e-3;

double MarkerOffset(const LinkModel& model) {
  return model.thickness_mm / 2 - model.markers.center_depth_mm;
}

// A force of 1 N at a site of the first path; the others' follow from them: the skin is one of revolution.
struct UnitForce {
  int site = 0;
  int direction = 0;  // column of the site's frame
};

std::vector<UnitForce> UnitForces(const LoadSites& sites) {
  std::vector<UnitForce> forces;
  for (int row = 0; row < sites.rows; ++row) {
    for (int first = 0; first < sites.columns_per_path; ++first) {
      for (int direction = 0; direction < 3; ++direction) {
        forces.push_back({row * sites.columns + first, direction});
      }
    }
  }
  return forces;
}

void SizeColumns(const LinkModel& model, const LoadSites& sites, SkinTangent& tangent) {
  for (auto* matrix : {&tangent.inward_mm_n, &tangent.around_mm_n, &tangent.along_mm_n}) {
    matrix->resize(3 * model.markers.count(), sites.count());
  }
}

// `answer_mm`: of the markers to `force`, stacked. Fills the columns of the force's sites on all paths.
void FillColumns(const LinkModel& model, const LoadSites& sites, const UnitForce& force,
                 const Eigen::VectorXd& answer_mm, SkinTangent& tangent) {
  const int markers = model.markers.count(), paths = model.markers.paths;
  auto& matrix = force.direction == 0   ? tangent.inward_mm_n
                 : force.direction == 1 ? tangent.around_mm_n
                                        : tangent.along_mm_n;
  for (int path = 0; path < paths; ++path) {
    const Mat3 turn =
        Eigen::AngleAxisd(path * model.markers.path_pitch_rad(), Vec3::UnitZ()).toRotationMatrix();
    const int column = force.site + path * sites.columns_per_path;
    for (int m = 0; m < markers; ++m) {
      const int to = model.MarkerIndex((model.PathOf(m) + path) % paths, model.RingOf(m));
      matrix.col(column).segment<3>(3 * to) = (turn * answer_mm.segment<3>(3 * m)).cast<float>();
    }
  }
}

}  // namespace

void MarkerMotions(const LinkModel& model, const ShellMesh& mesh, const NonlinearShell& shell,
                   const ShellState& state, const Eigen::VectorXd& step, Eigen::VectorXd& stacked_mm) {
  const double offset = MarkerOffset(model);
  stacked_mm.resize(3 * model.markers.count());
  for (int m = 0; m < model.markers.count(); ++m) {
    const int node = mesh.NodeOfMarker(model, m);
    const auto i = static_cast<size_t>(node);
    const Vec3& d = state.directors[i];
    const Vec3& t = state.tangents[i];
    const Eigen::Index at = shell.Dof(node, 0);  // a marker's node is free
    const Vec3 turn = step[at + 3] * t + step[at + 4] * d.cross(t);
    stacked_mm.segment<3>(3 * m) = step.segment<3>(at) + offset * turn.cross(d);
  }
}

void MarkerDisplacements(const LinkModel& model, const ShellMesh& mesh, const ShellState& state,
                         Eigen::VectorXd& stacked_mm) {
  const double offset = MarkerOffset(model);
  stacked_mm.resize(3 * model.markers.count());
  for (int m = 0; m < model.markers.count(); ++m) {
    const int node = mesh.NodeOfMarker(model, m);
    const auto i = static_cast<size_t>(node);
    stacked_mm.segment<3>(3 * m) = state.AtOffset(node, offset) - mesh.mid_mm[i] - offset * mesh.normals[i];
  }
}

SkinTangent LinearTangent(const LinkModel& model, int refinement, const LoadSites& sites) {
  const LinearShell shell(model, refinement);
  const double offset = MarkerOffset(model);
  const auto stacked = [&](const ShellDisplacement& u) {
    Eigen::VectorXd all(3 * model.markers.count());
    for (int m = 0; m < model.markers.count(); ++m) {
      all.segment<3>(3 * m) = u.AtOffset(shell.mesh(), shell.mesh().NodeOfMarker(model, m), offset);
    }
    return all;
  };
  SkinTangent tangent;
  tangent.per_pressure = stacked(shell.PerPressure());
  tangent.offset_mm = Eigen::VectorXd::Zero(tangent.per_pressure.size());
  SizeColumns(model, sites, tangent);
  for (const UnitForce& force : UnitForces(sites)) {
    const auto site = static_cast<size_t>(force.site);
    std::vector<NodalLoad> loads;
    for (const auto& [node, share] : sites.spreads[site]) {
      loads.push_back({node, share * sites.frames[site].col(force.direction)});
    }
    FillColumns(model, sites, force, stacked(shell.Solve(loads)), tangent);
  }
  return tangent;
}

struct PressurisedTangents::Shell {
  Shell(const LinkModel& link, int refinement, const LoadSites& load_sites)
      : model(link),
        sites(load_sites),
        mesh(MakeShellMesh(link, refinement)),
        shell(SkinSurface(mesh), link.material),
        solver(shell, {.tolerance_n =
                           1e-7 * link.material.youngs_modulus_mpa * link.thickness_mm * link.thickness_mm}),
        hessian(shell.Pattern()),
        factor(hessian),
        rest(shell.Rest()) {}

  struct Known {
    SkinTangent tangent;
    ShellState state;
    Eigen::VectorXd by_pressure;  // motion of the shell, mm or rad / MPa
  };

  bool Inflate(double from_mpa, double to_mpa, ShellState& state);
  bool Compute(Known& known);
  const Known* Learn(int step);

  LinkModel model;
  LoadSites sites;
  ShellMesh mesh;
  NonlinearShell shell;
  EquilibriumSolver solver;
  Eigen::SparseMatrix<double> hessian;
  Eigen::VectorXd gradient;
  SparseCholesky factor;
  ShellState rest;
  std::map<int, Known> known;  // by pressure in steps of the grid
  const Known* last = nullptr;
};

// In steps no longer than what a skin of this stiffness takes at once.
bool PressurisedTangents::Shell::Inflate(double from_mpa, double to_mpa, ShellState& state) {
  const double longest = kPressureStep * PressureScale(model);
  const int steps = std::max(1, static_cast<int>(std::ceil(std::abs(to_mpa - from_mpa) / longest)));
  for (int i = 1; i <= steps; ++i) {
    const FollowerPressure pressure(model.thickness_mm, from_mpa + (to_mpa - from_mpa) * i / steps);
    const ElementLoad* loads[] = {&pressure};
    if (!solver.Solve(loads, {}, state).ok()) return false;
  }
  return true;
}

bool PressurisedTangents::Shell::Compute(Known& fresh) {
  const ShellState& state = fresh.state;
  SkinTangent& tangent = fresh.tangent;
  const FollowerPressure pressure(model.thickness_mm, tangent.pressure_mpa);
  const FollowerPressure unit(model.thickness_mm, 1);
  const ElementLoad* inflating[] = {&pressure};
  shell.Hessian(state, inflating, gradient, hessian);
  if (!factor.Factorise(hessian)) return false;
  MarkerDisplacements(model, mesh, state, tangent.offset_mm);
  // The gradient of the pressure's energy alone: that with it less that without.
  Eigen::VectorXd with, without;
  const ElementLoad* one[] = {&unit};
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

PressurisedTangents::PressurisedTangents(const LinkModel& model, int refinement, const LoadSites& sites)
    : shell_(std::make_unique<Shell>(model, refinement, sites)) {}
PressurisedTangents::~PressurisedTangents() = default;

// From the nearest pressure that is known. Null: no equilibrium.
const PressurisedTangents::Shell::Known* PressurisedTangents::Shell::Learn(int step) {
  constexpr size_t kMostKept = 16;
  Known fresh{{}, rest, {}};
  double from_mpa = 0;
  if (!known.empty()) {
    const auto distance = [&](const auto& entry) { return std::abs(entry.first - step); };
    const auto nearest = std::min_element(
        known.begin(), known.end(), [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
    const Known& near = nearest->second;
    fresh.state = near.state;
    from_mpa = near.tangent.pressure_mpa;
    const double change = step * kGridMpa - from_mpa;
    if (std::abs(change) <= kPressureStep * PressureScale(model)) {
      shell.Step(change * near.by_pressure, fresh.state);  // where it will be, nearly
    }
  }
  fresh.tangent.pressure_mpa = step * kGridMpa;
  if (!Inflate(from_mpa, fresh.tangent.pressure_mpa, fresh.state)) return nullptr;
  if (!Compute(fresh)) return nullptr;
  if (known.size() >= kMostKept) {
    known.erase(step > known.begin()->first ? known.begin() : std::prev(known.end()));
  }
  return &known.emplace(step, std::move(fresh)).first->second;
}

const SkinTangent* PressurisedTangents::At(double pressure_mpa) {
  const double steps = std::round(pressure_mpa / kGridMpa);
  if (!(std::abs(steps) < 1e9)) return nullptr;  // NaN too
  const int step = static_cast<int>(steps);
  const auto found = shell_->known.find(step);
  const Shell::Known* known = found != shell_->known.end() ? &found->second : shell_->Learn(step);
  if (known == nullptr) return nullptr;
  shell_->last = known;
  return &known->tangent;
}

const ShellState& PressurisedTangents::Inflated() const {
  return shell_->last->state;
}

}  // namespace taclink
