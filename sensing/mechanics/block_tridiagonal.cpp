#include "sensing/mechanics/block_tridiagonal.h"

#include <cassert>

#include "sensing/mechanics/dense.h"

namespace taclink {

BlockTridiagonal::BlockTridiagonal(Eigen::Index block, Eigen::Index blocks)
    : block_(block), blocks_(blocks) {
  const auto n = static_cast<size_t>(blocks);
  inverse_.assign(n, Eigen::MatrixXd(block, block));
  below_.assign(n, Eigen::MatrixXd(block, block));
  off_diagonal_.assign(n, Eigen::MatrixXd(block, block));
  inverse_f_.assign(n, Eigen::MatrixXf(block, block));
  below_f_.assign(n, Eigen::MatrixXf(block, block));
}

bool BlockTridiagonal::Factorise(const Eigen::SparseMatrix<double>& lower) {
  assert(lower.rows() == block_ * blocks_);
  for (auto& matrix : inverse_) matrix.setZero();
  for (auto& matrix : off_diagonal_) matrix.setZero();
  for (Eigen::Index column = 0; column < lower.cols(); ++column) {
    const Eigen::Index j = column / block_;
    for (Eigen::SparseMatrix<double>::InnerIterator it(lower, column); it; ++it) {
      const Eigen::Index i = it.row() / block_;
      assert(i == j || i == j + 1);
      auto& to = i == j ? inverse_[static_cast<size_t>(i)] : off_diagonal_[static_cast<size_t>(i)];
      to(it.row() - i * block_, column - j * block_) = it.value();
    }
  }
  for (size_t i = 0; i < inverse_.size(); ++i) {
    inverse_[i].triangularView<Eigen::StrictlyUpper>() = inverse_[i].transpose();
    if (i > 0) {
      below_[i].setZero();
      dense::AddProduct(1, off_diagonal_[i], inverse_[i - 1], false, below_[i]);
      dense::AddProduct(-1, below_[i], off_diagonal_[i], true, inverse_[i]);
      below_f_[i] = below_[i].cast<float>();
    }
    if (!dense::InvertSymmetric(inverse_[i])) return false;
    inverse_f_[i] = inverse_[i].cast<float>();
  }
  return true;
}

void BlockTridiagonal::Solve(const Eigen::VectorXd& rhs, Eigen::VectorXd& x) const {
  assert(rhs.size() == block_ * blocks_);
  x = rhs;
  const auto part = [&](size_t i) { return x.segment(static_cast<Eigen::Index>(i) * block_, block_); };
  for (size_t i = 1; i < inverse_.size(); ++i) part(i).noalias() -= below_[i] * part(i - 1);
  for (size_t i = inverse_.size(); i-- > 0;) {
    part(i) = inverse_[i] * part(i);
    if (i + 1 < inverse_.size()) part(i).noalias() -= below_[i + 1].transpose() * part(i + 1);
  }
}

void BlockTridiagonal::SolveRows(const Eigen::MatrixXf& rhs, const std::vector<Eigen::Index>& filled,
                                 Eigen::MatrixXf& x) {
  assert(rhs.cols() == block_ * blocks_ && filled.size() == inverse_.size());
  x.resize(rhs.rows(), rhs.cols());
  const auto part = [&](Eigen::MatrixXf& all, size_t i, Eigen::Index rows) {
    return all.block(0, static_cast<Eigen::Index>(i) * block_, rows, block_);
  };
  // Forward; what is not filled is never read.
  forward_.resize(rhs.rows(), rhs.cols());
  for (size_t i = 0; i < filled.size(); ++i) {
    part(forward_, i, filled[i]) = rhs.block(0, static_cast<Eigen::Index>(i) * block_, filled[i], block_);
    if (i > 0)
      dense::AddProduct(-1.0F, part(forward_, i - 1, filled[i - 1]), below_f_[i], true,
                        part(forward_, i, filled[i - 1]));
  }
  for (size_t i = filled.size(); i-- > 0;) {
    part(x, i, rhs.rows()).setZero();
    dense::AddProduct(1.0F, part(forward_, i, filled[i]), inverse_f_[i], false, part(x, i, filled[i]));
    if (i + 1 < filled.size())
      dense::AddProduct(-1.0F, part(x, i + 1, rhs.rows()), below_f_[i + 1], false, part(x, i, rhs.rows()));
  }
}

}  // namespace taclink
