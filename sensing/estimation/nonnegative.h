#pragma once

#include <Eigen/Core>
#include <vector>

namespace taclink {

/// Minimizes 1/2 x'Hx - b'x over x >= 0: the active-set method of [lawson1974, chapter 23], with a Cholesky
/// factor that grows by a row where a variable comes in. The minimum does not depend on where it starts. One
/// thread.
class NonNegativeSolver {
 public:
  /// `h`: symmetric but for rounding, both halves, in double or single precision. `support`: on entry where
  /// to start, on return the variables above zero. Returns x; the reference holds until the next call. False
  /// in `converged` where it gave up.
  template <typename Matrix>
  const Eigen::VectorXd& Solve(const Matrix& h, const Eigen::VectorXd& b, std::vector<int>& support);
  bool converged() const { return converged_; }

 private:
  template <typename Matrix>
  bool Append(const Matrix& h, int variable);
  template <typename Matrix>
  void Refactor(const Matrix& h, size_t from);
  void SolveOnSupport(const Eigen::VectorXd& b);
  template <typename Matrix>
  bool StepToOptimum(const Matrix& h, const Eigen::VectorXd& b);

  std::vector<int> in_, refused_;  // refused: that could not come in since one last did
  Eigen::MatrixXd factor_;
  Eigen::VectorXd x_, trial_, gradient_;
  std::vector<char> is_in_;
  bool converged_ = true;
  int work_ = 0;
};

}  // namespace taclink
