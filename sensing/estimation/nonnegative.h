#pragma once

#include <Eigen/Core>
#include <vector>

namespace taclink {

/// Minimizes 1/2 x'Hx - b'x over x >= 0: Lawson and Hanson's active set (Solving Least Squares Problems,
/// 1974, chapter 23), with a Cholesky factor that grows by a row where a variable comes in. The minimum does
/// not depend on where it starts. One thread.
class NonNegativeSolver {
 public:
  /// `h`: symmetric, both halves. `support`: on entry where to start, on return the variables above zero.
  /// Returns x; the reference holds until the next call. False in `converged` where it gave up.
  const Eigen::VectorXd& Solve(const Eigen::MatrixXd& h, const Eigen::VectorXd& b, std::vector<int>& support);
  bool converged() const { return converged_; }

 private:
  bool Append(const Eigen::MatrixXd& h, int variable);
  void Refactor(const Eigen::MatrixXd& h, size_t from);
  void SolveOnSupport(const Eigen::VectorXd& b);
  bool StepToOptimum(const Eigen::MatrixXd& h, const Eigen::VectorXd& b);

  std::vector<int> in_;
  Eigen::MatrixXd factor_;
  Eigen::VectorXd x_, on_support_, trial_, gradient_;
  std::vector<char> is_in_;
  bool converged_ = true;
  int work_ = 0;
};

}  // namespace taclink
