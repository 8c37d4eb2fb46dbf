#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <array>
#include <span>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/shell/nonlinear_shell.h"
#include "sensing/shell/shell_mesh.h"

namespace taclink {

/// Where a shell's state has the markers. A marker sits on the inner wall, and a stretched wall gets thinner:
/// silicone keeps its volume, so with the area stretch A / A0 of the elements around the marker's node
///   marker = mid - (t/2 A0/A + dome) director,
/// dome: how far the marker's center is inside the inner wall, which does not stretch. Vectors are stacked,
/// three numbers a marker, by marker index; link frame, mm. Constant after construction.
class MarkerMap {
 public:
  MarkerMap(const LinkModel& model, const ShellMesh& mesh);

  int markers() const { return static_cast<int>(nodes_.size()); }
  int node(int marker) const { return nodes_[static_cast<size_t>(marker)]; }

  /// Half the thickness of the stretched wall at a marker.
  double HalfThickness(std::span<const Vec3> mids_mm, int marker) const;
  Vec3 Position(std::span<const Vec3> mids_mm, std::span<const Vec3> directors, int marker) const;
  /// Of all markers from the slack skin.
  void Displacements(const ShellState& state, Eigen::VectorXd& stacked_mm) const;

  /// Derivative of the displacements by the shell's degrees of freedom: 3 markers x dofs, row by row.
  using Jacobian = Eigen::SparseMatrix<double, Eigen::RowMajor>;
  Jacobian MakeJacobian(const NonlinearShell& shell) const;
  /// Sets the values of a matrix of MakeJacobian.
  void WriteJacobian(const NonlinearShell& shell, const ShellState& state, Jacobian& jacobian) const;
  /// The part of it by the marker's own node with the wall's thickness held: 3 x 5.
  Eigen::Matrix<double, 3, 5> OwnJacobian(const ShellState& state, int marker) const;

 private:
  // An element at the marker's node, with its corners.
  using Quad = std::array<int, 4>;
  template <typename Visit>
  void ForEachEntry(const NonlinearShell& shell, const ShellState& state, int marker, Visit visit) const;

  double half_thickness_mm_, dome_mm_;
  std::vector<int> nodes_;
  std::vector<std::array<Quad, 4>> around_;  // by marker
  std::vector<double> rest_area_mm2_;        // of these four, by marker
  std::vector<Vec3> rest_mm_;
};

}  // namespace taclink
