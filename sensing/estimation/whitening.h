#pragma once

#include <Eigen/Core>
#include <memory>

namespace taclink {

/// Makes errors independent, of unit variance: a matrix M' with M M' = C^-1, C = S + U U'. S is given by a
/// factor that others share, U by its columns, far fewer than rows, so that a change of C costs little. With
/// S = L L', W = L^-1 U and A A' = I + W' W (Cholesky), M' = (I - W K' W') L^-1, K = A^-T (I + A)^-1
/// [andrews1968], [whitaker2002]. Single precision. Constant between calls of Set, by one thread at a time.
class Whitening {
 public:
  static constexpr int kMostLast = 4;
  using SmallMatrix =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMostLast, kMostLast>;

  /// `lower`: L; `columns`: U. False: one of them is not finite.
  bool Set(std::shared_ptr<const Eigen::MatrixXf> lower, Eigen::MatrixXf columns);
  Eigen::Index size() const { return columns_.rows(); }
  /// x := M' x.
  void Apply(Eigen::Ref<Eigen::MatrixXf> x) const;
  Eigen::VectorXd Applied(const Eigen::VectorXd& x) const;
  Eigen::MatrixXd Applied(const Eigen::MatrixXd& x) const;
  /// M x; of M' e, that is C^-1 e.
  Eigen::VectorXd Transposed(const Eigen::VectorXd& x) const;
  /// C x.
  Eigen::VectorXd Covariance(const Eigen::VectorXd& x) const;
  const Eigen::MatrixXf& columns() const { return columns_; }
  /// Covariance of the last `count` (at most kMostLast) columns' shares in an error that all rows show;
  /// before, it is the identity.
  SmallMatrix LastPosterior(Eigen::Index count) const;

 private:
  std::shared_ptr<const Eigen::MatrixXf> lower_;
  Eigen::MatrixXf columns_, whitened_, shrunk_;  // U, W, W K'
  SmallMatrix last_factor_;                      // the lower right corner of A, up to kMostLast
};

}  // namespace taclink
