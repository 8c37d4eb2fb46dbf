#pragma once

#include <Eigen/Core>
#include <memory>

#include "sensing/estimation/factored_covariance.h"

namespace taclink {

/// Makes errors independent, of unit variance: a matrix M' with M M' = C^-1, C = S + U U'. S is shared with
/// others, U is given by its columns, far fewer than rows, so that a change of C costs little. With
/// B' B = S^-1, W = B U and A A' = I + W' W (Cholesky), M' = (I - W K' W') B, K = A^-T (I + A)^-1
/// [andrews1968], [whitaker2002]. Single precision. Immutable between calls of Set.
class Whitening {
 public:
  static constexpr int kMostLast = 4;
  using SmallMatrix =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMostLast, kMostLast>;

  /// `shared`: S; `columns`: U. False: one of them is not finite.
  bool Set(std::shared_ptr<const FactoredCovariance> shared, Eigen::MatrixXf columns);
  Eigen::Index size() const { return columns_.rows(); }
  /// x := M' x.
  void Apply(Eigen::Ref<Eigen::MatrixXf> x) const;
  /// The rest of Apply, for B x; returns A^-1 W' B x. M' x has the Gram matrix of B x less that of the
  /// result.
  Eigen::MatrixXf Finish(Eigen::Ref<Eigen::MatrixXf> whitened) const;
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
  std::shared_ptr<const FactoredCovariance> shared_;
  Eigen::MatrixXf columns_, whitened_, factor_, shifted_factor_;  // U, W, A, I + A
  SmallMatrix last_factor_;  // the lower right corner of A, up to kMostLast
};

}  // namespace taclink
