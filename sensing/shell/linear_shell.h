#pragma once

#include <memory>
#include <span>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"
#include "sensing/shell/shell_mesh.h"

namespace taclink {

struct NodalLoad {
  int node = 0;
  Vec3 force_n = Vec3::Zero();
};

/// Displacement of every node of a ShellMesh: of the mid-surface, and the rotation vector of its normal.
struct ShellDisplacement {
  std::vector<Vec3> translations_mm;
  std::vector<Vec3> rotations_rad;  ///< no part about the normal

  /// Displacement of the material point `offset_mm` outside the mid-surface on a node's normal (inside:
  /// negative).
  Vec3 AtOffset(const ShellMesh& mesh, int node, double offset_mm) const;
};

/// Linear elastic Mindlin shell (MITC4), clamped at both ends, nodal rotations free: forces to displacements.
/// Constant after construction, which factorises the stiffness (about 0.1 s at 24 x 10, refinement 1).
class LinearShell {
 public:
  LinearShell(const LinkModel& model, int refinement);
  ~LinearShell();
  LinearShell(LinearShell&&) noexcept;

  const ShellMesh& mesh() const;

  /// Equilibrium under forces on nodes; loads on clamped nodes do nothing.
  ShellDisplacement Solve(std::span<const NodalLoad> loads) const;

  /// Displacement for a gauge pressure of 1 MPa, applied on the mid-surface (see PressureLoad); scale it.
  const ShellDisplacement& PerPressure() const;

 private:
  struct Solver;
  std::unique_ptr<Solver> solver_;
};

}  // namespace taclink
