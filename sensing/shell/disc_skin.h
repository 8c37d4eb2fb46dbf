#pragma once

#include <Eigen/Core>
#include <deque>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/shell/body_force.h"
#include "sensing/shell/pressed_skin.h"

namespace taclink {

/// A rigid body that presses along a link's inward normal: a flat round disc, or a sphere. The skin slides on
/// it without friction.
struct SkinDisc {
  bool on = false;                 ///< otherwise it is not there
  double angle_rad = 0, z_mm = 0;  ///< where on the link's profile
  double diameter_mm = 0;
  bool is_sphere = false;
  /// Of its face, or the sphere's foremost point, from the undeformed outer surface; of one with a force: the
  /// most.
  double depth_mm = 0;
  std::optional<double> force_n;  ///< along its axis, positive; its depth is found
};

struct SkinLoad {
  double pressure_mpa = 0;
  std::vector<SkinDisc> discs;
  Vec3 specific_force_mps2 = Vec3::Zero();  ///< gravity less acceleration, link frame; zero: weightless
  /// Constant forces on the shell's degrees of freedom, N; zero on rotations, where a moment has no
  /// potential. Empty: none.
  Eigen::VectorXd dead_n = {};
  double wall_stiffness = 1;  ///< of the wall under discs and at the tube, times PressedSkinOptions'
};

/// Depth of a disc that is not there.
inline constexpr double kOffMm = std::numeric_limits<double>::quiet_NaN();

/// A skin in equilibrium with a SkinLoad, or a guess at it.
struct SkinBalance {
  ShellState state;
  std::vector<double> depth_mm;  ///< by disc
  std::vector<bool> limited;     ///< by disc: its force is not reached at its most depth
};

/// How a balance changes as the load does, per unit of what the load depends on.
struct SkinRates {
  std::vector<Vec3> mids_mm, directors;
  std::vector<double> depth_mm;
};

enum class BalanceStop {
  kConverged,
  kMaxIterations,
  kNotFinite,
  kUnstable,  ///< the state is no minimum of the energy at the discs' depths: the skin would snap
};
const char* Name(BalanceStop stop);

struct BalanceSummary {
  BalanceStop stop = BalanceStop::kConverged;
  int iterations = 0;
  int factorizations = 0;
  double residual_n = 0;  ///< largest entry, N or N mm, at the end
  bool ok() const { return stop == BalanceStop::kConverged; }
};

/// A link's skin as the nonlinear shell between pressure, discs and the inner tube. For many states near one
/// another: Newton's method with a matrix that is kept while it serves, with Broyden's updates
/// [broyden1965], [kelley2003, chapter 4], and the discs' unknown depths solved along with the skin, which
/// holds where a force alone would let it snap. No line search: a guess that is too far fails. One thread.
class DiscSkin {
 public:
  /// `disc_count`: how many discs every SkinLoad has.
  DiscSkin(const LinkModel& model, size_t disc_count, const PressedSkinOptions& options);
  ~DiscSkin();

  SkinBalance Rest() const;
  /// A guess with the nodes there, by node; directors need not be unit. No disc is on.
  SkinBalance NearTo(std::span<const Vec3> mids_mm, std::span<const Vec3> directors) const;

  /// From a guess to the equilibrium, which is stable if it was found; `balance` is spoilt if not.
  BalanceSummary Balance(const SkinLoad& load, SkinBalance& balance);

  /// Of the equilibrium that Balance found last, `span` apart from `before` to `after` it.
  SkinRates RatesAt(const SkinLoad& before, const SkinLoad& after, double span, const SkinBalance& balance);

  /// By disc, of a balance; the force's entries are zero where there is none.
  std::vector<RigidContact::Summary> Contacts(const SkinLoad& load, const SkinBalance& balance);

  /// What a state is out of balance by with the discs where it has them, by degree of freedom, N or N mm:
  /// internal forces less what acts.
  const Eigen::VectorXd& Residual(const SkinLoad& load, const SkinBalance& balance);
  /// Forces that the elastic skin exerts, by degree of freedom; in a balance all but rounding of them are on
  /// translations.
  Eigen::VectorXd InternalForces(const ShellState& state) const;

  const ShellMesh& mesh() const { return mesh_; }
  int factorizations() const { return factorizations_; }

 private:
  struct Factor;

  RigidBody BodyOf(const SkinDisc& disc, double depth_mm) const;
  double WallStiffness(const SkinLoad& load) const;
  void Apply(const SkinLoad& load, const SkinBalance& balance);
  double Misfit(const SkinLoad& load, const SkinBalance& balance);
  bool Factorize(const SkinLoad& load, const ShellState& state);
  void LearnDepths(const SkinLoad& load, const SkinBalance& balance);
  Eigen::VectorXd DepthGradient(size_t disc, const SkinDisc& place, double depth_mm, const ShellState& state);
  void Solve(const Eigen::VectorXd& forces, const Eigen::VectorXd& disc_forces);
  void Improve();
  double StepLimit() const;
  void Advance(const SkinLoad& load, double share, SkinBalance& balance);
  bool ReleaseLimits(const SkinLoad& load, SkinBalance& balance) const;

  LinkModel model_;
  PressedSkinOptions options_;
  ShellMesh mesh_;
  NonlinearShell shell_;
  FollowerPressure pressure_;
  std::vector<Eigen::Vector4d> corner_areas_mm2_;  // body_ refers to them
  BodyForce body_;
  std::unique_ptr<RigidContact> tube_;
  std::deque<RigidContact> discs_;
  std::vector<const ElementLoad*> loads_;
  std::unique_ptr<Factor> factor_;
  int factorizations_ = 0;
  int learnt_with_ = -1;  // which of them
  // Of the current iteration.
  std::vector<size_t> searched_;       // discs whose depth is unknown
  Eigen::VectorXd gradient_, excess_;  // of their forces over what is asked
  Eigen::MatrixXd by_depth_, answer_;  // gradient by depth, a column a searched disc; and solved
  Eigen::MatrixXd stiffness_;          // of the discs against the skin
  Eigen::VectorXd step_, depth_step_;
  std::vector<Eigen::VectorXd> taken_;  // steps, with the matrix at hand
};

}  // namespace taclink
