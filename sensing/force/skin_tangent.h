#pragma once

#include <Eigen/Core>
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

/// A force of 1 N at a site of the first path; the others' answers follow from it: the skin is one of
/// revolution.
struct UnitForce {
  int site = 0;
  int direction = 0;  ///< column of the site's frame
};
std::vector<UnitForce> UnitForces(const LoadSites& sites);

/// For all markers and sites; not set.
void SizeColumns(const LinkModel& model, const LoadSites& sites, SkinTangent& tangent);

/// The columns of a force's sites on all paths. `answer_mm`: of the markers to it, stacked.
void FillColumns(const LinkModel& model, const LoadSites& sites, const UnitForce& force,
                 const Eigen::VectorXd& answer_mm, SkinTangent& tangent);

/// The markers' motion by a small step of the shell (by its degrees of freedom), to first order, mm.
void MarkerMotions(const LinkModel& model, const ShellMesh& mesh, const NonlinearShell& shell,
                   const ShellState& state, const Eigen::VectorXd& step, Eigen::VectorXd& stacked_mm);

/// Displacement of all markers' centres from rest.
void MarkerDisplacements(const LinkModel& model, const ShellMesh& mesh, const ShellState& state,
                         Eigen::VectorXd& stacked_mm);

}  // namespace taclink
