#include "sensing/force/skin_tangent.h"

#include <Eigen/CholmodSupport>
#include <cmath>
#include <functional>
#include <map>

#include "sensing/mechanics/equilibrium.h"
#include "sensing/mechanics/linear_shell.h"

namespace taclink {
namespace {

constexpr double kGridMpa = 0.05e-3;

double MarkerOffset(const LinkModel& model) {
  return model.thickness_mm / 2 - model.markers.center_depth_mm;
}

// Fills all columns from those of one path: the skin is one of revolution.
// `respond`: displacements of the markers, stacked, to a unit force at a site.
void FillBySymmetry(const LinkModel& model, const LoadSites& sites, SkinTangent& tangent,
                    const std::function<Eigen::VectorXd(size_t site, const Vec3& force)>& respond) {
  const int markers = model.markers.count(), paths = model.markers.paths;
  for (auto* matrix : {&tangent.inward_mm_n, &tangent.around_mm_n, &tangent.along_mm_n}) {
    matrix->resize(3 * markers, sites.count());
  }
  for (int row = 0; row < sites.rows; ++row) {
    for (int first = 0; first < sites.columns_per_path; ++first) {
      const int base = row * sites.columns + first;
      for (int direction = 0; direction < 3; ++direction) {
        const Eigen::VectorXd answer =
            respond(static_cast<size_t>(base), sites.frames[static_cast<size_t>(base)].col(direction));
        auto& matrix = direction == 0   ? tangent.inward_mm_n
                       : direction == 1 ? tangent.around_mm_n
                                        : tangent.along_mm_n;
        for (int path = 0; path < paths; ++path) {
          const Mat3 turn =
              Eigen::AngleAxisd(path * model.markers.path_pitch_rad(), Vec3::UnitZ()).toRotationMatrix();
          const int column = base + path * sites.columns_per_path;
          for (int m = 0; m < markers; ++m) {
            const int to = model.MarkerIndex((model.PathOf(m) + path) % paths, model.RingOf(m));
            matrix.col(column).segment<3>(3 * to) = (turn * answer.segment<3>(3 * m)).cast<float>();
          }
        }
      }
    }
  }
}

}  // namespace

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
  FillBySymmetry(model, sites, tangent, [&](size_t site, const Vec3& force) {
    std::vector<NodalLoad> loads;
    for (const auto& [node, share] : sites.spreads[site]) loads.push_back({node, share * force});
    return stacked(shell.Solve(loads));
  });
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
        state(shell.Rest()) {
    factor.cholmod().print = 0;
    factor.analyzePattern(hessian);
  }

  bool Inflate(double pressure_mpa);
  bool Compute(SkinTangent& tangent);
  Eigen::VectorXd MarkersBy(const Eigen::VectorXd& step) const;

  LinkModel model;
  LoadSites sites;
  ShellMesh mesh;
  NonlinearShell shell;
  EquilibriumSolver solver;
  Eigen::SparseMatrix<double> hessian;
  Eigen::VectorXd gradient;
  Eigen::CholmodSupernodalLLT<Eigen::SparseMatrix<double>, Eigen::Lower> factor;
  ShellState state;
  double pressure_mpa = 0;
  std::map<int, SkinTangent> known;  // by pressure in steps of the grid
};

// In steps, from the pressure before.
bool PressurisedTangents::Shell::Inflate(double target_mpa) {
  constexpr double kStepMpa = 4e-4;
  const double from = pressure_mpa;
  const int steps = std::max(1, static_cast<int>(std::ceil(std::abs(target_mpa - from) / kStepMpa)));
  ShellState trial = state;
  for (int i = 1; i <= steps; ++i) {
    const FollowerPressure pressure(model.thickness_mm, from + (target_mpa - from) * i / steps);
    const ElementLoad* loads[] = {&pressure};
    if (!solver.Solve(loads, {}, trial).ok()) return false;
  }
  state = std::move(trial);
  pressure_mpa = target_mpa;
  return true;
}

// The markers' motion by a small step of the shell, to first order.
Eigen::VectorXd PressurisedTangents::Shell::MarkersBy(const Eigen::VectorXd& step) const {
  const double offset = MarkerOffset(model);
  Eigen::VectorXd all(3 * model.markers.count());
  for (int m = 0; m < model.markers.count(); ++m) {
    const int node = mesh.NodeOfMarker(model, m);
    const auto i = static_cast<size_t>(node);
    const auto value = [&](int c) { return shell.Dof(node, c) >= 0 ? step[shell.Dof(node, c)] : 0.0; };
    const Vec3& d = state.directors[i];
    const Vec3& t = state.tangents[i];
    const Vec3 turn = value(3) * t + value(4) * d.cross(t);
    all.segment<3>(3 * m) = Vec3(value(0), value(1), value(2)) + offset * turn.cross(d);
  }
  return all;
}

bool PressurisedTangents::Shell::Compute(SkinTangent& tangent) {
  const FollowerPressure pressure(model.thickness_mm, pressure_mpa);
  const FollowerPressure unit(model.thickness_mm, 1);
  const ElementLoad* loads[] = {&pressure};
  shell.Hessian(state, loads, gradient, hessian);
  factor.factorize(hessian);
  if (factor.info() != Eigen::Success) return false;
  tangent.pressure_mpa = pressure_mpa;
  MarkerDisplacements(model, mesh, state, tangent.offset_mm);
  // The gradient of the pressure's energy alone: that with it less that without.
  Eigen::VectorXd with, without;
  const ElementLoad* one[] = {&unit};
  shell.Gradient(state, one, with);
  shell.Gradient(state, {}, without);
  tangent.per_pressure = MarkersBy(factor.solve(without - with));
  FillBySymmetry(model, sites, tangent, [&](size_t site, const Vec3& force) {
    Eigen::VectorXd load = Eigen::VectorXd::Zero(shell.dof_count());
    for (const auto& [node, share] : sites.spreads[site])
      load.segment<3>(shell.Dof(node, 0)) += share * force;
    return MarkersBy(factor.solve(load));
  });
  return true;
}

PressurisedTangents::PressurisedTangents(const LinkModel& model, int refinement, const LoadSites& sites)
    : shell_(std::make_unique<Shell>(model, refinement, sites)) {}
PressurisedTangents::~PressurisedTangents() = default;

const SkinTangent* PressurisedTangents::At(double pressure_mpa) {
  constexpr size_t kMostKept = 16;
  if (!std::isfinite(pressure_mpa)) return nullptr;
  const int step = static_cast<int>(std::lround(pressure_mpa / kGridMpa));
  if (const auto found = shell_->known.find(step); found != shell_->known.end()) return &found->second;
  if (!shell_->Inflate(step * kGridMpa)) return nullptr;
  if (shell_->known.size() >= kMostKept) {
    const auto farthest =
        step > shell_->known.begin()->first ? shell_->known.begin() : std::prev(shell_->known.end());
    shell_->known.erase(farthest);
  }
  SkinTangent tangent;
  if (!shell_->Compute(tangent)) return nullptr;
  return &shell_->known.emplace(step, std::move(tangent)).first->second;
}

const ShellState& PressurisedTangents::Inflated() const {
  return shell_->state;
}

}  // namespace taclink
