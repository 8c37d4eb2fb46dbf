#include "sensing/estimation/factored_covariance.h"
#include "sensing/shell/dense.h"

namespace taclink {

DenseCovariance::DenseCovariance(Eigen::MatrixXd covariance_mm2)
    : covariance_mm2_(covariance_mm2.cast<float>()), is_factored_(dense::Cholesky(covariance_mm2)) {
  lower_ = covariance_mm2.cast<float>();
}

void DenseCovariance::Whiten(Eigen::Ref<Eigen::MatrixXf> x) const {
  dense::SolveLower(lower_, x);
}

Eigen::VectorXf DenseCovariance::WhitenTransposed(const Eigen::VectorXf& x) const {
  Eigen::MatrixXf solved = x;
  dense::SolveLowerTransposed(lower_, solved);
  return solved;
}

Eigen::VectorXf DenseCovariance::Times(const Eigen::VectorXf& x) const {
  return covariance_mm2_.selfadjointView<Eigen::Lower>() * x;
}

Eigen::Matrix3f DenseCovariance::Block(int marker, int other) const {
  if (marker < other) return Block(other, marker).transpose();
  const Eigen::Matrix3f block = covariance_mm2_.block<3, 3>(3 * marker, 3 * other);
  return marker == other ? Eigen::Matrix3f(block.selfadjointView<Eigen::Lower>()) : block;
}

}  // namespace taclink
