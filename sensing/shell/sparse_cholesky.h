#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <memory>

namespace taclink {

/// Cholesky factor of a sparse symmetric matrix whose structure never changes (CHOLMOD [chen2008],
/// supernodal). Works in the calling thread alone; its memory is made once. One thread at a time.
class SparseCholesky {
 public:
  /// `pattern`: lower triangle, compressed; its numbers do not matter.
  explicit SparseCholesky(const Eigen::SparseMatrix<double>& pattern);
  ~SparseCholesky();

  /// Lower triangle with the pattern's structure. False: not positive definite, and there is nothing to solve
  /// with.
  bool Factorise(const Eigen::SparseMatrix<double>& matrix);
  /// One column a right side. `x` may not be `rhs`.
  void Solve(const Eigen::Ref<const Eigen::MatrixXd>& rhs, Eigen::MatrixXd& x);
  void Solve(const Eigen::VectorXd& rhs, Eigen::VectorXd& x);
  Eigen::VectorXd Solve(const Eigen::VectorXd& rhs);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace taclink
