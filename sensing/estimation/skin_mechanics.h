#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <map>
#include <memory>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/shell/equilibrium.h"
#include "sensing/shell/marker_map.h"
#include "sensing/shell/nonlinear_shell.h"
#include "sensing/shell/shell_mesh.h"

namespace taclink {

/// The skin under pressure alone.
struct InflatedSkin {
  double pressure_mpa = 0;
  ShellState state;
  Eigen::VectorXd markers_mm;          ///< displacements from the slack skin, stacked
  Eigen::VectorXd markers_mm_per_mpa;  ///< their derivative by the pressure
  std::vector<Vec3> mids_per_mpa, directors_per_mpa;
};

/// What a link's estimates share: the shell, its markers, the sites where loads may act, and the skin under
/// pressure alone. Sites are all free nodes, row by row (site = (row - 1) * columns + column). One thread.
class SkinMechanics {
 public:
  /// `refinement`: elements per interval of the marker grid; 0: as many as the skin's dents ask for.
  explicit SkinMechanics(const LinkModel& model, int refinement = 0);

  const LinkModel& model() const { return model_; }
  const ShellMesh& mesh() const { return mesh_; }
  const NonlinearShell& shell() const { return shell_; }
  const MarkerMap& markers() const { return markers_; }
  int marker_count() const { return markers_.markers(); }

  int site_count() const { return columns() * site_rows(); }
  int columns() const { return mesh_.columns; }
  int site_rows() const { return mesh_.rows - 2; }
  int NodeOfSite(int site) const { return site + mesh_.columns; }
  const Vec3& RestSite(int site) const { return mesh_.mid_mm[static_cast<size_t>(NodeOfSite(site))]; }
  const Vec3& RestMarker(int marker) const {
    return mesh_.mid_mm[static_cast<size_t>(markers_.node(marker))];
  }
  /// Beyond the last rings of markers, towards a clamp.
  bool IsBeyondMarkers(int site) const;
  double DistanceToClamp(int site) const;
  /// A load at a site spreads over its neighbours, for no contact is a point: site's share (row) of a load
  /// (column); columns sum to 1.
  const Eigen::SparseMatrix<double>& spread() const { return spread_; }

  /// Units in which constants that were found on the shipped cylinder hold for any skin: lengths go as
  /// sqrt(R t), over which a shell's dents decay, forces as E t^2. Both are 1 for that cylinder.
  double length_unit() const { return length_unit_; }
  double force_unit() const { return force_unit_; }

  /// Pressures that are solved are multiples of this, MPa.
  double pressure_step() const { return pressure_step_mpa_; }

  /// At the pressure, or at the nearest at which the skin stands: a reading scatters about zero, where a
  /// little suction buckles it. Null: two steps nearer to zero there is no stable equilibrium that smaller
  /// pressures lead to. Interpolated between pressures that were solved (cubic, a ten-thousandth of the
  /// growth); valid until the next call.
  const InflatedSkin* Inflated(double pressure_mpa);

 private:
  const InflatedSkin* Solved(int part);
  const InflatedSkin* Between(double pressure_mpa, int parts);
  bool Solve(InflatedSkin& skin);
  void MakeSpread();

  LinkModel model_;
  ShellMesh mesh_;
  NonlinearShell shell_;
  MarkerMap markers_;
  Eigen::SparseMatrix<double> spread_;
  double length_unit_ = 1, force_unit_ = 1, pressure_step_mpa_ = 0;
  EquilibriumSolver equilibrium_;
  std::map<int, std::unique_ptr<InflatedSkin>> solved_;  // by pressure in parts of a step; null: none
  InflatedSkin between_;
};

}  // namespace taclink
