#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <array>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "sensing/core/known_loads.h"
#include "sensing/core/link_model.h"
#include "sensing/shell/body_force.h"
#include "sensing/shell/equilibrium.h"
#include "sensing/shell/marker_map.h"
#include "sensing/shell/nonlinear_shell.h"
#include "sensing/shell/shell_mesh.h"

namespace taclink {

/// Derivatives of a stacked vector by KnownLoads::Stacked().
using ByKnownLoads = Eigen::Matrix<double, Eigen::Dynamic, KnownLoads::kCount>;

/// The skin under known loads alone, which nothing touches.
struct UntouchedSkin {
  KnownLoads loads;
  ShellState state;
  Eigen::VectorXd markers_mm;     ///< displacements from the slack skin without weight, stacked
  ByKnownLoads markers_by_loads;  ///< their derivatives, mm/MPa and mm/(m/s^2)
};

/// What a link's estimates share: the shell, its markers, the sites where loads may act, and the skin under
/// known loads alone. Sites are all free nodes, row by row (site = (row - 1) * columns + column). One thread.
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
  /// N per mm^2 of the undeformed mid-surface and m/s^2.
  double mass_per_area() const { return mass_per_area_; }
  const std::vector<Eigen::Vector4d>& corner_areas_mm2() const { return corner_areas_mm2_; }
  /// Derivatives of the shell's gradient by the known loads at a state.
  void GradientByLoads(const ShellState& state, ByKnownLoads& out) const;

  /// At these loads, or at the nearest pressure at which the skin stands: a reading scatters about zero,
  /// where a little suction buckles it. Null: two steps nearer to zero there is no stable equilibrium that
  /// smaller loads lead to, or the loads are beyond all measure. Interpolated between equilibria on a grid of
  /// pressure and specific force, by first-order expansions about the corners of a simplex, weighted so that
  /// quadratic dependence is exact. Valid until the next call.
  const UntouchedSkin* Untouched(const KnownLoads& loads);

 private:
  /// Pressure in parts of a step, specific force in steps.
  using GridPoint = std::array<int, KnownLoads::kCount>;
  struct Equilibrium : UntouchedSkin {
    using NodeByLoads = Eigen::Matrix<double, 3, KnownLoads::kCount>;
    std::vector<NodeByLoads> mids_by_loads, directors_by_loads;
  };
  struct Corner {
    const Equilibrium* skin = nullptr;
    double share = 0;
  };
  const Equilibrium* Solved(const GridPoint& point);
  static GridPoint Before(const GridPoint& point);
  const UntouchedSkin* Between(const KnownLoads& loads, int parts);
  const UntouchedSkin* Blend(const KnownLoads& loads, std::span<const Corner> corners);
  bool Solve(Equilibrium& skin);
  void MakeSpread();
  void SetUpWeight();

  LinkModel model_;
  ShellMesh mesh_;
  NonlinearShell shell_;
  MarkerMap markers_;
  Eigen::SparseMatrix<double> spread_;
  double length_unit_ = 1, force_unit_ = 1, pressure_step_mpa_ = 0;
  double mass_per_area_ = 0, specific_force_step_mps2_ = 0;
  std::vector<Eigen::Vector4d> corner_areas_mm2_;
  ByKnownLoads gradient_by_specific_force_;  // constant; the pressure's column is zero
  EquilibriumSolver equilibrium_;
  std::map<GridPoint, std::unique_ptr<Equilibrium>> solved_;  // null: there is none
  UntouchedSkin between_;
};

/// Known loads as loads of the shell's elements. What is zero is left out.
class AppliedLoads {
 public:
  AppliedLoads(const SkinMechanics& mechanics, const KnownLoads& loads);
  AppliedLoads(const AppliedLoads&) = delete;
  AppliedLoads& operator=(const AppliedLoads&) = delete;
  NonlinearShell::Loads loads() const { return {all_.data(), count_}; }

 private:
  FollowerPressure pressure_;
  BodyForce body_;
  std::array<const ElementLoad*, 2> all_{};
  size_t count_ = 0;
};

}  // namespace taclink
