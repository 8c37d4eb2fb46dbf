#include "sensing/mechanics/block_tridiagonal.h"

#include <cassert>
#include <utility>

#include "sensing/mechanics/dense.h"

namespace taclink {

BlockTridiagonal::BlockTridiagonal(Eigen::Index block, Eigen::Index blocks)
    : block_(block),
      inverse_(static_cast<size_t>(blocks), Eigen::MatrixXf(block, block)),
      below_(static_cast<size_t>(blocks), Eigen::MatrixXf(block, block)) {}

bool BlockTridiagonal::Factorise(const Eigen::SparseMatrix<double>& lower) {
  assert(lower.cols() == block_ * static_cast<Eigen::Index>(inverse_.size()));
  Eigen::MatrixXd off(block_, block_), next_off(block_, block_);  // B_i, B_(i+1)
  Eigen::MatrixXd diagonal(block_, block_), before(block_, block_), below(block_, block_);
  for (size_t i = 0; i < inverse_.size(); ++i) {
    diagonal.setZero();
    next_off.setZero();
    const Eigen::Index first = static_cast<Eigen::Index>(i) * block_;
    for (Eigen::Index column = 0; column < block_; ++column) {
      for (Eigen::SparseMatrix<double>::InnerIterator it(lower, first + column); it; ++it) {
        const Eigen::Index row = it.row() - first;
        assert(row < 2 * block_);
        (row < block_ ? diagonal(row, column) : next_off(row - block_, column)) = it.value();
      }
    }
    diagonal.triangularView<Eigen::StrictlyUpper>() = diagonal.transpose();
    if (i > 0) {
      below.setZero();
      dense::AddProduct(1, off, before, false, below);
      dense::AddProduct(-1, below, off, true, diagonal);
      below_[i] = below.cast<float>();
    }
    if (!dense::InvertSymmetric(diagonal)) return false;
    inverse_[i] = diagonal.cast<float>();
    std::swap(diagonal, before);
    std::swap(off, next_off);
  }
  return true;
}

void BlockTridiagonal::Solve(const Eigen::VectorXd& rhs, Eigen::VectorXd& x) const {
  assert(rhs.size() == block_ * static_cast<Eigen::Index>(inverse_.size()));
  Eigen::VectorXf all = rhs.cast<float>(), product(block_);
  const auto part = [&](size_t i) { return all.segment(static_cast<Eigen::Index>(i) * block_, block_); };
  for (size_t i = 1; i < inverse_.size(); ++i) {
    dense::Product(below_[i], part(i - 1), product);
    part(i) -= product;
  }
  for (size_t i = inverse_.size(); i-- > 0;) {
    dense::Product(inverse_[i], part(i), product);
    part(i) = product;
    if (i + 1 == inverse_.size()) continue;
    dense::TransposedProduct(below_[i + 1], part(i + 1), product);
    part(i) -= product;
  }
  x = all.cast<double>();
}

void BlockTridiagonal::SolveRows(Eigen::MatrixXf& rhs, const std::vector<Eigen::Index>& filled,
                                 Eigen::MatrixXf& x) const {
  assert(rhs.cols() == block_ * static_cast<Eigen::Index>(inverse_.size()) &&
         filled.size() == inverse_.size());
  x.resize(rhs.rows(), rhs.cols());
  const auto part = [&](Eigen::MatrixXf& all, size_t i, Eigen::Index rows) {
    return all.block(0, static_cast<Eigen::Index>(i) * block_, rows, block_);
  };
  for (size_t i = 1; i < filled.size(); ++i) {
    dense::AddProduct(-1.0F, part(rhs, i - 1, filled[i - 1]), below_[i], true, part(rhs, i, filled[i - 1]));
  }
  for (size_t i = filled.size(); i-- > 0;) {
    part(x, i, rhs.rows()).setZero();
    dense::AddProduct(1.0F, part(rhs, i, filled[i]), inverse_[i], false, part(x, i, filled[i]));
    if (i + 1 == filled.size()) continue;
    dense::AddProduct(-1.0F, part(x, i + 1, rhs.rows()), below_[i + 1], false, part(x, i, rhs.rows()));
  }
}

}  // namespace taclink
