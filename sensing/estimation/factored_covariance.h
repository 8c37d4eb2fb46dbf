#pragma once

#include <Eigen/Core>

#include "sensing/core/geometry.h"

namespace taclink {

/// A covariance S of stacked markers, mm^2, with a matrix B, B' B = S^-1, that whitens: B x has independent
/// entries of unit variance if S is the covariance of x. Single precision. Immutable.
class FactoredCovariance {
 public:
  virtual ~FactoredCovariance() = default;
  /// x := B x, by columns.
  virtual void Whiten(Eigen::Ref<Eigen::MatrixXf> x) const = 0;
  /// B' x.
  virtual Eigen::VectorXf WhitenTransposed(const Eigen::VectorXf& x) const = 0;
  /// S x.
  virtual Eigen::VectorXf Times(const Eigen::VectorXf& x) const = 0;
  /// The covariance of two markers' displacements.
  virtual Eigen::Matrix3f Block(int marker, int other) const = 0;
};

/// Any covariance, by the Cholesky factor L of the dense matrix: B = L^-1.
class DenseCovariance : public FactoredCovariance {
 public:
  /// `covariance_mm2`: lower half.
  explicit DenseCovariance(Eigen::MatrixXd covariance_mm2);
  /// False: the covariance is not positive definite; the other functions must not be called.
  bool is_factored() const { return is_factored_; }

  void Whiten(Eigen::Ref<Eigen::MatrixXf> x) const override;
  Eigen::VectorXf WhitenTransposed(const Eigen::VectorXf& x) const override;
  Eigen::VectorXf Times(const Eigen::VectorXf& x) const override;
  Eigen::Matrix3f Block(int marker, int other) const override;

 private:
  Eigen::MatrixXf covariance_mm2_, lower_;
  bool is_factored_;
};

}  // namespace taclink
