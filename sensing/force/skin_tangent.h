#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/force/load_sites.h"
#include "sensing/mechanics/nonlinear_shell.h"

namespace taclink {

/// How the markers answer to small loads about one state of the skin. Markers' displacements are stacked,
/// three numbers each, link frame.
struct SkinTangent {
  double pressure_mpa = 0;
  Eigen::VectorXd offset_mm;     ///< displacement that the pressure alone makes
  Eigen::VectorXd per_pressure;  ///< its derivative, mm / MPa
  Eigen::MatrixXf inward_mm_n;   ///< a column a site: a force inwards
  Eigen::MatrixXf around_mm_n;   ///< the same, around the axis
  Eigen::MatrixXf along_mm_n;    ///< the same, along it
};

/// About the rest shape; the pressure's part is linear in the pressure.
SkinTangent LinearTangent(const LinkModel& model, int refinement, const LoadSites& sites);

/// About the inflated shape, by the nonlinear shell. Keeps what it has computed, by pressure; one thread.
class PressurisedTangents {
 public:
  PressurisedTangents(const LinkModel& model, int refinement, const LoadSites& sites);
  ~PressurisedTangents();

  /// That of the nearest pressure on a grid of 0.05 kPa; computed when it is first asked for. Null: the skin
  /// has no equilibrium at this pressure.
  const SkinTangent* At(double pressure_mpa);

  /// The skin's state at the pressure last asked for, that of the last tangent returned.
  const ShellState& Inflated() const;

 private:
  struct Shell;
  std::unique_ptr<Shell> shell_;
};

/// The markers' motion by a small step of the shell (by its degrees of freedom), to first order, mm.
void MarkerMotions(const LinkModel& model, const ShellMesh& mesh, const NonlinearShell& shell,
                   const ShellState& state, const Eigen::VectorXd& step, Eigen::VectorXd& stacked_mm);

/// Displacement of all markers' centres from rest.
void MarkerDisplacements(const LinkModel& model, const ShellMesh& mesh, const ShellState& state,
                         Eigen::VectorXd& stacked_mm);

}  // namespace taclink
