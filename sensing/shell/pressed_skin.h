#pragma once

#include <deque>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "sensing/core/known_loads.h"
#include "sensing/core/link_model.h"
#include "sensing/shell/body_force.h"
#include "sensing/shell/equilibrium.h"
#include "sensing/shell/marker_map.h"
#include "sensing/shell/rigid_contact.h"
#include "sensing/shell/shell_mesh.h"

namespace taclink {

/// Young's modulus times thickness / radius at mid-length, MPa: the pressure that would double the radius of
/// a linear skin.
double PressureScale(const LinkModel& model);
/// Of it: what Newton's method takes at once.
inline constexpr double kPressureStep = 0.044;

struct PressedSkinOptions {
  int refinement = 2;           ///< elements per interval of the marker grid
  int refinement_along = 0;     ///< of those between rings; 0: as many as between paths
  double step_mm = 1;           ///< longest motion of a body from one equilibrium to the next
  double least_step_mm = 0.01;  ///< gives up below
  /// Longest change of pressure, of PressureScale; of weight, what moves a skin as far.
  double pressure_step = kPressureStep;
  double spacing_mm = 0.8;  ///< of contact points
  /// Of the wall under a body, times Young's modulus / thickness: a soft wall gives way locally, which a
  /// shell does not know. The default makes its forces those of three-dimensional bricks
  /// (docs/reports/calculix.md).
  double stiffness = 0.45;
};

/// Why a skin's way to a new state ended, and what it took.
struct PressSummary {
  EquilibriumStop stop = EquilibriumStop::kConverged;
  double reached = 1;  ///< share of the way
  int steps = 0;
  int iterations = 0;
  int shifted = 0;
  double residual_n = 0;
  bool stable = true;
  /// Times that the skin left its equilibria for others far away: it buckled, or a dent snapped through.
  /// Which one it finds may depend on the steps.
  int snaps = 0;
  double snapped_mm = 0;  ///< longest motion of a node in one of them
  bool ok() const { return stop == EquilibriumStop::kConverged && reached == 1; }
  /// In words: "converged in 12 steps, snapped 1 time, by up to 3.1 mm", "stopped at 40 % of the way: no
  /// descent".
  std::string Text() const;
};

/// A link's skin as the nonlinear shell, under pressure and weight and pressed by rigid bodies; the inner
/// tube stops it. Each change is followed in steps, as long as they succeed. One thread.
class PressedSkin {
 public:
  PressedSkin(const LinkModel& model, const PressedSkinOptions& options);

  /// From the known loads before, in a straight line. A model without a density has no weight. Errors are in
  /// the summary; the state stays at the last equilibrium.
  PressSummary Load(const KnownLoads& loads);
  /// The pressure alone.
  PressSummary Inflate(double pressure_mpa) { return Load({pressure_mpa, known_loads_.specific_force_mps2}); }
  /// A body that does not touch yet. Returns its index.
  int AddBody(const RigidBody& body, bool sticks);
  /// Takes all bodies away; the skin returns to `untouched`, an equilibrium without them under these loads.
  void RemoveBodies(const ShellState& untouched);
  /// Moves all bodies in a straight line, together, `by_mm` each by index.
  PressSummary Move(std::span<const Vec3> by_mm);

  const NonlinearShell& shell() const { return shell_; }
  const ShellMesh& mesh() const { return mesh_; }
  const ShellState& state() const { return state_; }
  double pressure_mpa() const { return known_loads_.pressure_mpa; }
  const KnownLoads& known_loads() const { return known_loads_; }
  RigidContact::Summary ContactOf(int body) const {
    return bodies_[static_cast<size_t>(body)].Summarize(state_);
  }
  RigidContact::Summary TubeContact() const;
  /// Where a marker's centre is.
  Vec3 Marker(int marker) const;

 private:
  struct Point {
    double at = 0;  // share of the way
    ShellState state;
  };
  template <typename Advance>
  PressSummary Follow(double longest, double least, double usual_mm, Advance advance);
  void Apply(const KnownLoads& loads);
  EquilibriumSummary Settle(ShellState& state);
  static ShellState Extrapolated(const Point& before, const Point& last, double at);

  LinkModel model_;
  PressedSkinOptions options_;
  ShellMesh mesh_;
  MarkerMap markers_;
  NonlinearShell shell_;
  EquilibriumSolver solver_;
  FollowerPressure pressure_;
  std::vector<Eigen::Vector4d> corner_areas_mm2_;  // body_force_ refers to them
  BodyForce body_force_;
  KnownLoads known_loads_;
  std::unique_ptr<RigidContact> tube_;
  std::deque<RigidContact> bodies_;
  ShellState state_;
};

}  // namespace taclink
