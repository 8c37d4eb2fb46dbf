#pragma once

#include <Eigen/SparseCore>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"
#include "sensing/shell/element_load.h"
#include "sensing/shell/nonlinear_element.h"
#include "sensing/shell/ring_shell.h"
#include "sensing/shell/shell_mesh.h"

namespace taclink {

/// Any piece of shell: quadrilaterals, flat or warped, and which of its degrees of freedom stand still.
struct ShellSurface {
  std::vector<Vec3> mids_mm;
  std::vector<Vec3> directors;  ///< unit, at rest
  /// Unit, across the directors: rotations are about this and about director x tangent. Turned along with the
  /// directors.
  std::vector<Vec3> tangents;
  std::vector<std::array<int, 4>> elements;  ///< counter-clockwise seen from where the directors point to
  double thickness_mm = 0;
  /// Of a mesh of revolution that is numbered as MakeShellMesh does: elements around. 0: any other.
  int columns = 0;
  /// By node: three translations, rotation about the tangent, rotation about director x tangent.
  std::vector<std::array<bool, 5>> fixed;
};

/// The skin of a link, clamped at both ends. `mesh` of MakeShellMesh.
ShellSurface SkinSurface(const ShellMesh& mesh);

/// Degrees of freedom of a node that does not stand still.
inline constexpr int kNodeDofs = 5;

/// Where a shell's nodes are, and how they are turned.
struct ShellState {
  std::vector<Vec3> mids_mm;
  std::vector<Vec3> directors;
  std::vector<Vec3> tangents;

  /// The material point that was `offset_mm` outside the mid-surface.
  Vec3 AtOffset(int node, double offset_mm) const {
    const auto i = static_cast<size_t>(node);
    return mids_mm[i] + offset_mm * directors[i];
  }
};

/// A geometrically exact shell: energy, gradient and Hessian by its free degrees of freedom, five a node
/// (three translations in mm, two rotations about the state's own tangents, rad). See nonlinear_shell.md.
/// Constant after construction; may be shared by threads.
class NonlinearShell {
 public:
  NonlinearShell(ShellSurface surface, const Material& material);

  const ShellSurface& surface() const { return surface_; }
  const Material& material() const { return material_; }
  /// Not empty: all elements of a ring are alike, and gradients and energies are computed ring by ring.
  const std::optional<RingShell>& rings() const { return rings_; }
  int node_count() const { return static_cast<int>(surface_.mids_mm.size()); }
  int dof_count() const { return dof_count_; }
  /// Index of a node's degree of freedom (0..4), -1: it stands still.
  int Dof(int node, int component) const {
    return dofs_[static_cast<size_t>(node)][static_cast<size_t>(component)];
  }
  ShellState Rest() const { return {surface_.mids_mm, surface_.directors, surface_.tangents}; }

  using Loads = std::span<const ElementLoad* const>;
  /// Stored energy and that of the loads, N mm.
  double Energy(const ShellState& state, Loads loads) const;
  /// The same; sets `gradient`, N and N mm.
  double Gradient(const ShellState& state, Loads loads, Eigen::VectorXd& gradient) const;
  /// The same; sets the values of `hessian`, one of Pattern().
  double Hessian(const ShellState& state, Loads loads, Eigen::VectorXd& gradient,
                 Eigen::SparseMatrix<double>& hessian) const;
  /// Lower half of the Hessian, all zero, compressed.
  const Eigen::SparseMatrix<double>& Pattern() const { return pattern_; }

  /// Moves and turns the nodes; the rotations are exact.
  void Step(const Eigen::VectorXd& increment, ShellState& state) const;
  /// One node, by all five of its degrees of freedom.
  static void StepNode(int node, const Eigen::Matrix<double, 5, 1>& by, ShellState& state);

  ElementState StateOf(int element, const ShellState& state) const;

  static constexpr int kElementDofs = 4 * kNodeDofs;
  /// One element's part, with its loads, by the degrees of freedom of its corners, five each, those that
  /// stand still included.
  struct ElementPart {
    double energy_nmm = 0;
    Eigen::Matrix<double, kElementDofs, 1> gradient;
    Eigen::Matrix<double, kElementDofs, kElementDofs> hessian;
  };
  void SetElementPart(int element, const ShellState& state, Loads loads, ElementPart& part) const;

 private:
  template <typename Visit>
  double ForEachElement(DerivativeOrder order, const ShellState& state, Loads loads, Visit visit) const;
  double ByRings(DerivativeOrder order, const ShellState& state, Loads loads,
                 Eigen::VectorXd* gradient) const;
  void SetPart(int element, const ShellState& state, const ElementResponse& response,
               ElementPart& part) const;
  void AddAtCorners(const ShellState& state, int element, const ElementResponse& response,
                    Eigen::VectorXd& gradient) const;
  void AddAtNode(const ShellState& state, int node, const Vec3& force, const Vec3& by_director,
                 Eigen::VectorXd& gradient) const;
  const NonlinearElement& Element(int element) const {
    return elements_[static_cast<size_t>(rings_ ? element / rings_->columns() : element)];
  }
  void MakePattern();

  ShellSurface surface_;
  Material material_;
  std::vector<NonlinearElement> elements_;  // with rings_: one of each
  std::optional<RingShell> rings_;
  std::vector<std::array<int, 5>> dofs_;
  int dof_count_ = 0;
  Eigen::SparseMatrix<double> pattern_;
  // Where an element's matrix goes in the pattern's values, column by column; -1: nowhere.
  std::vector<std::array<int, kElementDofs * kElementDofs>> slots_;
};

}  // namespace taclink
