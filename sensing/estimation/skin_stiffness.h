#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <memory>
#include <optional>
#include <vector>

#include "sensing/estimation/skin_mechanics.h"
#include "sensing/shell/block_tridiagonal.h"

namespace taclink {

/// The factored tangent stiffness K of a skin: by blocks of rows of nodes at any state, or by harmonics at an
/// inflated skin. Not thread-safe.
class SkinStiffness {
 public:
  explicit SkinStiffness(const SkinMechanics& mechanics);

  /// At a state, which may be unstable; sets the shell's gradient there. False: K is singular or not finite.
  bool Set(const ShellState& state, const KnownLoads& loads, Eigen::VectorXd& gradient);
  void Set(const std::shared_ptr<const InflatedSkin>& skin) { rings_ = {skin, &skin->stiffness}; }
  /// Of an inflated skin: invariant under rotation.
  bool is_of_revolution() const { return rings_ != nullptr; }

  /// x = K^-1 rhs.
  void Solve(const Eigen::VectorXd& rhs, Eigen::VectorXd& x) const;
  /// rows := rows K^-1. `filled`: by row of nodes, the rows that are not zero there.
  void SolveRows(std::vector<BlockTridiagonal::Rows> filled, Eigen::MatrixXf& rows) const;

 private:
  const SkinMechanics& mechanics_;
  Eigen::SparseMatrix<double> hessian_;
  std::optional<BlockTridiagonal> factor_;      // made when it is asked for
  std::shared_ptr<const RingStiffness> rings_;  // instead of factor_
};

}  // namespace taclink
