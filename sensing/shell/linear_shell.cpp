#include "sensing/shell/linear_shell.h"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <cassert>

#include "sensing/shell/mitc4.h"

namespace taclink {
namespace {

std::array<ShellCorner, 4> CornersOf(const ShellMesh& mesh, const std::array<int, 4>& element) {
  std::array<ShellCorner, 4> corners;
  for (size_t i = 0; i < 4; ++i) {
    const auto node = static_cast<size_t>(element[i]);
    corners[i] = {mesh.mid_mm[node], mesh.normals[node], TangentsOf(mesh.normals[node])};
  }
  return corners;
}

}  // namespace

Vec3 ShellDisplacement::AtOffset(const ShellMesh& mesh, int node, double offset_mm) const {
  const auto i = static_cast<size_t>(node);
  return translations_mm[i] + offset_mm * rotations_rad[i].cross(mesh.normals[i]);
}

struct LinearShell::Solver {
  ShellMesh mesh;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor;
  ShellDisplacement per_pressure;

  // Only free nodes have equations; the clamped ones are the first and the last row of the mesh.
  int FirstDof(int node) const { return (node - mesh.columns) * kDofsPerNode; }
  int DofCount() const { return (mesh.node_count() - 2 * mesh.columns) * kDofsPerNode; }

  void Factorise(const Material& material);
  Eigen::VectorXd UnitPressureLoad() const;
  ShellDisplacement SolveFor(const Eigen::VectorXd& load) const;
};

void LinearShell::Solver::Factorise(const Material& material) {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(mesh.elements.size() * kElementDofs * kElementDofs);
  for (const auto& element : mesh.elements) {
    const ElementMatrix k = Mitc4Stiffness(CornersOf(mesh, element), mesh.thickness_mm, material);
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) {
        const int node_i = element[static_cast<size_t>(i)], node_j = element[static_cast<size_t>(j)];
        if (mesh.IsClamped(node_i) || mesh.IsClamped(node_j)) continue;
        for (int a = 0; a < kDofsPerNode; ++a) {
          for (int b = 0; b < kDofsPerNode; ++b) {
            entries.emplace_back(FirstDof(node_i) + a, FirstDof(node_j) + b,
                                 k(i * kDofsPerNode + a, j * kDofsPerNode + b));
          }
        }
      }
    }
  }
  Eigen::SparseMatrix<double> stiffness(DofCount(), DofCount());
  stiffness.setFromTriplets(entries.begin(), entries.end());
  factor.compute(stiffness);
  assert(factor.info() == Eigen::Success);
}

Eigen::VectorXd LinearShell::Solver::UnitPressureLoad() const {
  Eigen::VectorXd load = Eigen::VectorXd::Zero(DofCount());
  for (const auto& element : mesh.elements) {
    const ElementVector f = PressureLoad(CornersOf(mesh, element));
    for (int i = 0; i < 4; ++i) {
      const int node = element[static_cast<size_t>(i)];
      if (mesh.IsClamped(node)) continue;
      load.segment<kDofsPerNode>(FirstDof(node)) += f.segment<kDofsPerNode>(i * kDofsPerNode);
    }
  }
  return load;
}

ShellDisplacement LinearShell::Solver::SolveFor(const Eigen::VectorXd& load) const {
  const Eigen::VectorXd solution = factor.solve(load);
  const auto nodes = static_cast<size_t>(mesh.node_count());
  ShellDisplacement result{std::vector<Vec3>(nodes, Vec3::Zero()), std::vector<Vec3>(nodes, Vec3::Zero())};
  for (int node = mesh.columns; node < mesh.node_count() - mesh.columns; ++node) {
    const auto i = static_cast<size_t>(node);
    const auto dofs = solution.segment<kDofsPerNode>(FirstDof(node));
    const auto tangents = TangentsOf(mesh.normals[i]);
    result.translations_mm[i] = dofs.head<3>();
    result.rotations_rad[i] = dofs[3] * tangents[0] + dofs[4] * tangents[1];
  }
  return result;
}

LinearShell::LinearShell(const LinkModel& model, int refinement) : solver_(std::make_unique<Solver>()) {
  solver_->mesh = MakeShellMesh(model, refinement);
  solver_->Factorise(model.material);
  solver_->per_pressure = solver_->SolveFor(solver_->UnitPressureLoad());
}

LinearShell::~LinearShell() = default;
LinearShell::LinearShell(LinearShell&&) noexcept = default;

const ShellMesh& LinearShell::mesh() const {
  return solver_->mesh;
}
const ShellDisplacement& LinearShell::PerPressure() const {
  return solver_->per_pressure;
}

ShellDisplacement LinearShell::Solve(std::span<const NodalLoad> loads) const {
  Eigen::VectorXd load = Eigen::VectorXd::Zero(solver_->DofCount());
  for (const auto& [node, force] : loads) {
    if (!solver_->mesh.IsClamped(node)) load.segment<3>(solver_->FirstDof(node)) += force;
  }
  return solver_->SolveFor(load);
}

}  // namespace taclink
