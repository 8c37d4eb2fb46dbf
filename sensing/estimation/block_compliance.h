#pragma once

#include <Eigen/SparseCore>

#include "sensing/estimation/skin_compliance.h"
#include "sensing/estimation/skin_mechanics.h"
#include "sensing/shell/block_tridiagonal.h"

namespace taclink {

/// At any state, stable or not: K is factored by rows of nodes.
class BlockCompliance final : public SkinCompliance {
 public:
  /// Referred to.
  explicit BlockCompliance(const SkinMechanics& mechanics);

  /// False: K is singular, or not finite.
  bool Set(const ShellState& state, double pressure_mpa);

  void Solve(const Eigen::VectorXd& forces, Eigen::VectorXd& motion) const override;
  const MarkerMap::Jacobian& jacobian() const override { return jacobian_; }
  Eigen::MatrixXf Displacements(const LoadCases& cases) const override;

 private:
  const SkinMechanics& mechanics_;
  Eigen::SparseMatrix<double> hessian_;
  BlockTridiagonal factor_;
  MarkerMap::Jacobian jacobian_;
};

}  // namespace taclink
