#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <vector>

namespace taclink {

/// Factor of a symmetric block-tridiagonal matrix, such as the stiffness of a tube that is meshed ring by
/// ring: an element couples neighboring rings only. Blocks are eliminated [golub2013], from both ends to the
/// middle one. With blocks D on the diagonal and B(j, i) beside it, j the neighbor of i nearer to the middle,
///   S = D at both ends,  C_i = B(j, i) S_i^-1,  S_j = D_j - C_i B(j, i)',
/// the middle block's from both sides. What begins in a block crosses half of the matrix at most before it
/// spreads, which is what makes many solutions at once cheaper than from one end.
/// Blocks are dense and inverted, so that a solution is a few matrix products, which run at the processor's
/// speed (a tenth of the time of a sparse factor's). The factor is made in double and kept in single
/// precision: it is for steps and derivatives, and what they are used for comes from states whose forces are
/// balanced in double. The matrix may be indefinite as long as no part of it that is eliminated is singular.
/// One thread.
class BlockTridiagonal {
 public:
  /// The size of the matrix is `blocks` times `block`.
  BlockTridiagonal(Eigen::Index block, Eigen::Index blocks);

  /// `lower`: lower triangle; nothing outside the blocks. False: singular, or not finite.
  bool Factorise(const Eigen::SparseMatrix<double>& lower);

  void Solve(const Eigen::VectorXd& rhs, Eigen::VectorXd& x) const;

  /// From a row to before another.
  struct Rows {
    Eigen::Index begin = 0, end = 0;
    Eigen::Index count() const { return end - begin; }
    /// The least that has both.
    Rows With(const Rows& other) const;
  };
  /// Replaces each row of `rows` by the solution for it. `filled`: by block, the rows that are not zero
  /// there; all others must be zero.
  void SolveRows(std::vector<Rows> filled, Eigen::MatrixXf& rows) const;

 private:
  /// Calls visit(i, j) for each block but the middle one, from the ends to there, with the neighbor that is
  /// nearer to it.
  template <typename Visit>
  void ForEachInward(Visit visit) const;
  template <typename Visit>
  void ForEachOutward(Visit visit) const;

  Eigen::Index block_, middle_;
  std::vector<Eigen::MatrixXf> inverse_, carried_;  // S_i^-1, C_i
};

}  // namespace taclink
