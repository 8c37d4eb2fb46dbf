#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "sensing/core/known_loads.h"
#include "sensing/core/link_model.h"
#include "sensing/shell/body_force.h"
#include "sensing/shell/inflated_skin.h"
#include "sensing/shell/marker_map.h"
#include "sensing/shell/nonlinear_shell.h"
#include "sensing/shell/shell_mesh.h"

namespace taclink {

/// Derivatives of a stacked vector by KnownLoads::Stacked().
using ByKnownLoads = Eigen::Matrix<double, Eigen::Dynamic, KnownLoads::kCount>;

class UntouchedSkins;

/// The skin under known loads alone, which nothing touches.
struct UntouchedSkin {
  KnownLoads loads;
  ShellState state;
  /// The skin without weight at nearly the same pressure; not null.
  std::shared_ptr<const InflatedSkin> weightless = nullptr;
  bool is_stiff_as_weightless = false;  ///< about: its weight changes the stiffness by little
  /// The skin whose stiffness is about its own, known by harmonics; null: there is none.
  std::shared_ptr<const InflatedSkin> inflated() const {
    return is_stiff_as_weightless ? weightless : nullptr;
  }
  /// Where to linearize it.
  const ShellState& about() const { return is_stiff_as_weightless ? weightless->state : state; }
  Eigen::VectorXd markers_mm;     ///< displacements from the slack skin without weight, stacked
  ByKnownLoads markers_by_loads;  ///< their derivatives, mm/MPa and mm/(m/s^2)
};

/// What a link's estimates share: the shell, its markers, the sites where loads may act, and the skin under
/// known loads alone. Sites are all free nodes, row by row (site = (row - 1) * columns + column). One thread.
class SkinMechanics {
 public:
  /// `refinement`: elements per interval of the marker grid; 0: as many as the skin's dents ask for.
  explicit SkinMechanics(const LinkModel& model, int refinement = 0);
  ~SkinMechanics();

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

  /// A small step of inflation, MPa: of 1.1 % of PressureScale.
  double pressure_step() const { return pressure_step_mpa_; }
  /// N per mm^2 of the undeformed mid-surface and m/s^2.
  double mass_per_area() const { return mass_per_area_; }
  const std::vector<Eigen::Vector4d>& corner_areas_mm2() const { return corner_areas_mm2_; }
  /// The skin's own specific force as loads of its degrees of freedom, N; empty: it has no weight.
  Eigen::VectorXd Weight(const KnownLoads& loads) const;
  /// Energy of a state under known loads, N mm; sets its gradient.
  double Gradient(const ShellState& state, const KnownLoads& loads, Eigen::VectorXd& gradient) const;
  /// Derivatives of the shell's gradient by the known loads at a state.
  void GradientByLoads(const ShellState& state, ByKnownLoads& out) const;

  /// The stable equilibrium under these loads that is clear of the tube. Pressure readings scatter about zero
  /// and a small suction buckles the skin: under suction without such an equilibrium, that of the nearest
  /// grid pressure up to two pressure steps closer to zero. Returns nullptr if none of them has one. Valid
  /// until the next call.
  const UntouchedSkin* Untouched(const KnownLoads& loads);

 private:
  void MakeSpread();
  void SetUpWeight();

  LinkModel model_;
  ShellMesh mesh_;
  NonlinearShell shell_;
  MarkerMap markers_;
  Eigen::SparseMatrix<double> spread_;
  double length_unit_ = 1, force_unit_ = 1, pressure_step_mpa_ = 0;
  double mass_per_area_ = 0;
  std::vector<Eigen::Vector4d> corner_areas_mm2_;
  ByKnownLoads gradient_by_specific_force_;  // constant; the pressure's column is zero
  std::unique_ptr<UntouchedSkins> untouched_;
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
