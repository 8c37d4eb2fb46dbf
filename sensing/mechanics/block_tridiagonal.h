#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <vector>

namespace taclink {

/// Factor of a symmetric block-tridiagonal matrix, such as the stiffness of a tube that is meshed ring by
/// ring: an element couples neighboring rings only. With the blocks D of the diagonal and B below it,
///   S_0 = D_0,  E_i = B_i S_(i-1)^-1,  S_i = D_i - E_i B_i'.
/// Blocks are dense and inverted, so that a solution is a few matrix products, which run at the processor's
/// speed (a tenth of the time of a sparse factor's). The factor is made in double and kept in single
/// precision: it is for steps and derivatives, and what they are used for comes from states whose forces are
/// balanced in double. The matrix may be indefinite as long as no leading part of it is singular. One thread.
class BlockTridiagonal {
 public:
  /// The size of the matrix is `blocks` times `block`.
  BlockTridiagonal(Eigen::Index block, Eigen::Index blocks);

  /// `lower`: lower triangle; nothing outside the blocks. False: singular, or not finite.
  bool Factorise(const Eigen::SparseMatrix<double>& lower);

  void Solve(const Eigen::VectorXd& rhs, Eigen::VectorXd& x) const;

  /// Rows of x are the solutions for the rows of `rhs`. Of block i, only the first `filled[i]` rows of `rhs`
  /// are read, and `filled` does not fall. `rhs` is used up.
  void SolveRows(Eigen::MatrixXf& rhs, const std::vector<Eigen::Index>& filled, Eigen::MatrixXf& x) const;

 private:
  Eigen::Index block_;
  std::vector<Eigen::MatrixXf> inverse_, below_;  // S_i^-1, E_i
};

}  // namespace taclink
