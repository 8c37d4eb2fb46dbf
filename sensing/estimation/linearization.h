#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "sensing/estimation/block_compliance.h"
#include "sensing/estimation/load_cases.h"
#include "sensing/estimation/patch_compliance.h"
#include "sensing/estimation/round_compliance.h"
#include "sensing/estimation/skin_mechanics.h"

namespace taclink {

/// The skin's equilibrium to first order about a state: with loads f at the sites and an error dq of the
/// known loads,
///   m = base + sum_k sum_s Column(k, s) f_ks + by_known_loads dq.
/// Directions k of a site: inward, around, along; the last two act on the outer wall, with their moment. A
/// state may be one that no stable equilibrium is near: the stiffness may be indefinite. One thread.
class Linearization {
 public:
  explicit Linearization(const SkinMechanics& mechanics);
  Linearization(const Linearization&) = delete;
  Linearization& operator=(const Linearization&) = delete;

  /// By BlockCompliance. False: the stiffness is singular there, or not finite.
  bool At(const ShellState& state, const KnownLoads& loads);
  /// At an inflated skin, by RoundCompliance.
  bool At(const std::shared_ptr<const InflatedSkin>& skin, const KnownLoads& loads);
  /// By PatchCompliance: `patch` has the sites where `state` is not about that of `round`.
  bool At(const ShellState& state, const KnownLoads& loads, std::shared_ptr<const RoundCompliance> round,
          std::vector<int> patch);
  /// Moves to a state nearby and keeps stiffness, columns and frames: only what the skin is out of balance by
  /// is that of the new state, exactly. What steps lead to is then the same equilibrium, in more of them.
  /// False: not finite.
  bool Rebase(const ShellState& state, const KnownLoads& loads);
  /// The same state under other known loads, to first order.
  void SetKnownLoads(const KnownLoads& loads);
  const SkinMechanics& mechanics() const { return mechanics_; }
  bool is_made() const { return is_made_; }
  /// Null: it was not linearized at an inflated skin.
  const std::shared_ptr<const RoundCompliance>& round() const { return round_; }
  /// Linearized at an inflated skin: stiffness and columns are invariant under rotation.
  bool is_of_revolution() const { return round_ != nullptr; }

  const ShellState& state() const { return state_; }
  /// Where stiffness, columns and frames are from.
  const ShellState& tangent_state() const { return tangent_state_; }
  const Eigen::VectorXd& base_mm() const { return base_mm_; }
  /// Directions of the load of a site, in its frame.
  enum Direction { kInward, kAround, kAlong };
  /// Of 1 N that acts on a site's node alone.
  LoadCases::Load ForceAt(Direction direction, int site) const;
  /// Of 1 N mm about the around or the along direction.
  LoadCases::Load CoupleAt(Direction axis, int site) const;
  /// What these loads displace, stacked markers, mm; by case.
  Eigen::MatrixXf Displacements(const LoadCases& cases) const { return compliance_->Displacements(cases); }
  const ByKnownLoads& by_known_loads() const { return by_known_loads_; }
  /// By site; columns inward, around, along; unit, perpendicular.
  const std::vector<Mat3>& frames() const { return frames_; }

  /// The transposes of all columns times forces on the markers (3 each, stacked), in one solution instead of
  /// three large products.
  std::array<Eigen::VectorXd, 3> PulledAtSites(const Eigen::VectorXd& at_markers);

  /// What acts on the skin, by site, in the site's frame: forces inward, around and along, couples about
  /// around and along.
  struct SiteLoads {
    std::array<Eigen::VectorXd, 3> forces_n;
    std::array<Eigen::VectorXd, 2> couples_nmm;
  };
  /// Where loads and an error of the known ones take the state, to first order. Returns
  /// the longest motion of a node, mm.
  double Step(const SiteLoads& loads, const Vec4& known_error, double longest_mm, ShellState& state);
  /// The markers' displacements from the slack skin to first order, where the last Step led without a limit.
  void FirstOrderMarkers(Eigen::VectorXd& stacked_mm) const;

 private:
  bool Finish(const ShellState& state, const KnownLoads& loads);
  void SetFrames();
  /// The rotations' part of a couple about an axis; of a force on the outer wall, which has one about the
  /// mid-surface.
  Vec2 Turning(int node, const Vec3& couple) const;
  Vec2 Moment(int node, const Vec3& direction) const;

  const SkinMechanics& mechanics_;
  std::shared_ptr<const RoundCompliance> round_;
  std::unique_ptr<PatchCompliance> patch_;  // made when it is asked for, as is block_
  std::unique_ptr<BlockCompliance> block_;
  const SkinCompliance* compliance_ = nullptr;  // selected by the last At: round_, patch_ or block_
  ShellState state_, tangent_state_;
  bool is_made_ = false;
  KnownLoads loads_, tangent_loads_;
  Eigen::VectorXd tangent_gradient_, tangent_base_mm_;
  Eigen::VectorXd gradient_, base_mm_, motion_;
  ByKnownLoads gradient_by_loads_, by_known_loads_;
  std::vector<Mat3> frames_;
};

}  // namespace taclink
