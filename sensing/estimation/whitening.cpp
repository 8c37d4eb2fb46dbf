#include "sensing/estimation/whitening.h"

#include <algorithm>
#include <utility>

#include "sensing/shell/dense.h"

namespace taclink {

bool Whitening::Set(std::shared_ptr<const FactoredCovariance> shared, Eigen::MatrixXf columns) {
  shared_ = std::move(shared);
  columns_ = std::move(columns);
  whitened_ = columns_;
  shared_->Whiten(whitened_);
  const Eigen::Index count = columns_.cols();
  Eigen::MatrixXf gram(count, count);
  dense::Gram(whitened_, gram);
  Eigen::MatrixXd factor = gram.cast<double>().triangularView<Eigen::Lower>();
  factor.diagonal().array() += 1;
  if (!dense::Cholesky(factor)) return false;
  const Eigen::Index last = std::min<Eigen::Index>(count, kMostLast);
  last_factor_ = factor.bottomRightCorner(last, last);
  factor_ = factor.cast<float>();
  shifted_factor_ = factor_;
  shifted_factor_.diagonal().array() += 1;
  return whitened_.allFinite() && factor_.allFinite();
}

// The corner of (A A')^-1 is that of the corner of A, which is lower triangular.
Whitening::SmallMatrix Whitening::LastPosterior(Eigen::Index count) const {
  SmallMatrix inverse = SmallMatrix::Identity(count, count);
  last_factor_.bottomRightCorner(count, count).triangularView<Eigen::Lower>().solveInPlace(inverse);
  return inverse.transpose() * inverse;
}

void Whitening::Apply(Eigen::Ref<Eigen::MatrixXf> x) const {
  shared_->Whiten(x);
  Finish(x);
}

Eigen::MatrixXf Whitening::Finish(Eigen::Ref<Eigen::MatrixXf> whitened) const {
  Eigen::MatrixXf explained(columns_.cols(), whitened.cols());
  if (columns_.cols() == 0) return explained;
  dense::TransposedProduct(whitened_, Eigen::MatrixXf(whitened), explained);
  dense::SolveLower(factor_, explained);
  Eigen::MatrixXf shares = explained;
  dense::SolveLowerTransposed(shifted_factor_, shares);
  dense::AddProduct(-1, whitened_, shares, false, whitened);
  return explained;
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
  Eigen::VectorXf single = x.cast<float>();
  if (columns_.cols() > 0) {
    Eigen::MatrixXf shares = whitened_.transpose() * single;
    dense::SolveLower(shifted_factor_, shares);
    dense::SolveLowerTransposed(factor_, shares);
    single -= whitened_ * shares;
  }
  return shared_->WhitenTransposed(single).cast<double>();
}

Eigen::VectorXd Whitening::Covariance(const Eigen::VectorXd& x) const {
  const Eigen::VectorXf single = x.cast<float>();
  Eigen::VectorXf all = shared_->Times(single);
  all += columns_ * (columns_.transpose() * single);
  return all.cast<double>();
}

}  // namespace taclink
