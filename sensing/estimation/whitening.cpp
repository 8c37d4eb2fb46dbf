#include "sensing/estimation/whitening.h"

#include <algorithm>
#include <utility>

#include "sensing/shell/dense.h"

namespace taclink {

bool Whitening::Set(std::shared_ptr<const Eigen::MatrixXf> lower, Eigen::MatrixXf columns) {
  lower_ = std::move(lower);
  columns_ = std::move(columns);
  whitened_ = columns_;
  dense::SolveLower(*lower_, whitened_);
  const Eigen::Index count = columns_.cols();
  Eigen::MatrixXf gram(count, count);
  dense::Gram(whitened_, gram);
  Eigen::MatrixXd factor = gram.cast<double>();
  factor.diagonal().array() += 1;
  if (!dense::Cholesky(factor)) return false;
  const Eigen::Index last = std::min<Eigen::Index>(count, kMostLast);
  last_factor_ = factor.bottomRightCorner(last, last);
  // K' = (I + A')^-1 A^-1.
  Eigen::MatrixXf single = factor.cast<float>(), shrink = Eigen::MatrixXf::Identity(count, count);
  dense::SolveLower(single, shrink);
  single.diagonal().array() += 1;
  dense::SolveLowerTransposed(single, shrink);
  shrunk_.setZero(columns_.rows(), count);
  dense::SetProduct(1, whitened_, shrink, shrunk_);
  return shrunk_.allFinite();
}

// The corner of (A A')^-1 is that of the corner of A, which is lower triangular.
Whitening::SmallMatrix Whitening::LastPosterior(Eigen::Index count) const {
  SmallMatrix inverse = SmallMatrix::Identity(count, count);
  last_factor_.bottomRightCorner(count, count).triangularView<Eigen::Lower>().solveInPlace(inverse);
  return inverse.transpose() * inverse;
}

void Whitening::Apply(Eigen::Ref<Eigen::MatrixXf> x) const {
  dense::SolveLower(*lower_, x);
  if (columns_.cols() == 0) return;
  Eigen::MatrixXf shares;
  dense::TransposedProduct(whitened_, Eigen::MatrixXf(x), shares);
  dense::AddProduct(-1, shrunk_, shares, false, x);
}

Eigen::VectorXd Whitening::Applied(const Eigen::VectorXd& x) const {
  return Applied(Eigen::MatrixXd(x));
}

Eigen::MatrixXd Whitening::Applied(const Eigen::MatrixXd& x) const {
  Eigen::MatrixXf single = x.cast<float>();
  Apply(single);
  return single.cast<double>();
}

Eigen::VectorXd Whitening::Transposed(const Eigen::VectorXd& x) const {
  Eigen::MatrixXf single = x.cast<float>();
  single -= whitened_ * (shrunk_.transpose() * single);
  dense::SolveLowerTransposed(*lower_, single);
  return single.col(0).cast<double>();
}

Eigen::VectorXd Whitening::Covariance(const Eigen::VectorXd& x) const {
  const Eigen::VectorXf single = x.cast<float>();
  const Eigen::VectorXf half = lower_->triangularView<Eigen::Lower>().transpose() * single;
  Eigen::VectorXf all = lower_->triangularView<Eigen::Lower>() * half;
  all += columns_ * (columns_.transpose() * single);
  return all.cast<double>();
}

}  // namespace taclink
