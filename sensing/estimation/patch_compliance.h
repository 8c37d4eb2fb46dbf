#pragma once

#include <Eigen/SparseCore>
#include <memory>
#include <utility>
#include <vector>

#include "sensing/estimation/round_compliance.h"
#include "sensing/shell/dense.h"

namespace taclink {

/// Where a state differs most from another.
struct StatePatch {
  std::vector<int> sites;  ///< in order
  /// The largest change of another site's node: its motion and, in SkinMechanics' units, 10 mm a radian by
  /// which its director turns.
  double outside_mm = 0;
};
StatePatch PatchBetween(const SkinMechanics& mechanics, const ShellState& from, const ShellState& to,
                        size_t most_sites);

/// About a state that differs from an inflated skin at some sites' nodes, the patch: K = K0 + E D E', K0 that
/// of the inflated skin, D the sum of what the patch's elements are stiffer by, E the patch's unknowns. By
/// Sherman, Morrison and Woodbury [golub2013],
///   K^-1 = K0^-1 - K0^-1 E (I + D G)^-1 D E' K0^-1,  G = E' K0^-1 E.
/// D is that of whole elements, whose corners are all in the patch or clamped: cut by nodes it would resist
/// rigid motions. The unknowns of the patch are in cylindrical coordinates, in which G's blocks are those of
/// RingStiffness::Inverse. Single precision.
class PatchCompliance final : public SkinCompliance {
 public:
  /// Referred to.
  explicit PatchCompliance(const SkinMechanics& mechanics);

  /// False: K is singular, or not finite. `sites`: the patch, in order.
  bool Set(std::shared_ptr<const RoundCompliance> round, const ShellState& state, double pressure_mpa,
           std::vector<int> sites);

  void Solve(const Eigen::VectorXd& forces, Eigen::VectorXd& motion) const override;
  const MarkerMap::Jacobian& jacobian() const override { return jacobian_; }
  Eigen::MatrixXf Displacements(const LoadCases& cases) const override;

 private:
  using Change = Eigen::SparseMatrix<float, Eigen::RowMajor>;
  using RowMajor = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  Vec2 TurnOf(int node) const;
  bool Has(int node) const;
  void WriteChange(const ShellState& state, double pressure_mpa);
  void WriteJacobian(const ShellState& state);
  void WriteCompliance();
  Eigen::MatrixXf PatchMotions(const LoadCases& cases) const;
  const Eigen::MatrixXf& Responses() const;
  void Gather(const Eigen::VectorXd& by_dof, Eigen::Ref<Eigen::VectorXf> of_patch) const;
  void Subtract(const Eigen::Ref<const Eigen::VectorXf>& of_patch, Eigen::VectorXd& by_dof) const;

  const SkinMechanics& mechanics_;
  std::shared_ptr<const RoundCompliance> round_;
  std::vector<int> sites_, place_;  // place_: by site, -1: not in the patch
  Change change_;                   // D
  Eigen::MatrixXf compliance_;      // G
  dense::LuFactor factor_;          // I + D G
  MarkerMap::Jacobian jacobian_, touched_jacobian_;
  // Of J that are the touched skin's: by the unknowns of the patch.
  struct TouchedRow {
    Eigen::Index row = 0;
    std::vector<std::pair<int, float>> entries;
  };
  std::vector<TouchedRow> touched_rows_;
  mutable Eigen::MatrixXf responses_;  // empty: not made
};

}  // namespace taclink
