#include "sensing/shell/block_tridiagonal.h"

#include <algorithm>
#include <cassert>

#include "sensing/shell/dense.h"
#include "sensing/shell/instructions.h"

namespace taclink {
namespace {

// The few entries of a block beside the diagonal, by row: an element couples a node to three of the next row.
class SparseBlock {
 public:
  explicit SparseBlock(Eigen::Index size) : size_(size), rows_(static_cast<size_t>(size)) {}

  // The block at (row, column), neighbors, of a matrix of which the lower triangle is there.
  void Set(const Eigen::SparseMatrix<double>& lower, Eigen::Index row, Eigen::Index column) {
    for (auto& entries : rows_) entries.clear();
    const Eigen::Index first = std::max(row, column) * size_;
    for (Eigen::Index c = 0; c < size_; ++c) {
      for (Eigen::SparseMatrix<double>::InnerIterator it(lower, std::min(row, column) * size_ + c); it;
           ++it) {
        const Eigen::Index r = it.row() - first;
        if (r < 0 || r >= size_) continue;
        rows_[static_cast<size_t>(row < column ? c : r)].push_back({row < column ? r : c, it.value()});
      }
    }
  }
  // sum := sum + scale a B'.
  void AddTimesTransposed(double scale, const Eigen::MatrixXd& a, Eigen::MatrixXd& sum) const {
    static void (*const kKernel)(const SparseBlock&, double, const Eigen::MatrixXd&, Eigen::MatrixXd&) =
        BestOf(AddPlain, AddAvx2, AddAvx2);
    kKernel(*this, scale, a, sum);
  }

 private:
  struct Entry {
    Eigen::Index column = 0;
    double value = 0;
  };

  static TACLINK_IN_KERNEL void Add(const SparseBlock& block, double scale, const Eigen::MatrixXd& a,
                                    Eigen::MatrixXd& sum) {
    for (Eigen::Index row = 0; row < block.size_; ++row) {
      double* to = sum.data() + row * sum.rows();
      const std::vector<Entry>& entries = block.rows_[static_cast<size_t>(row)];
      size_t k = 0;
      for (; k + 3 < entries.size(); k += 4) {
        const double *a0 = a.data() + entries[k].column * a.rows(),
                     *a1 = a.data() + entries[k + 1].column * a.rows(),
                     *a2 = a.data() + entries[k + 2].column * a.rows(),
                     *a3 = a.data() + entries[k + 3].column * a.rows();
        const double by0 = scale * entries[k].value, by1 = scale * entries[k + 1].value,
                     by2 = scale * entries[k + 2].value, by3 = scale * entries[k + 3].value;
        for (Eigen::Index i = 0; i < sum.rows(); ++i)
          to[i] += by0 * a0[i] + by1 * a1[i] + by2 * a2[i] + by3 * a3[i];
      }
      for (; k < entries.size(); ++k) {
        const double* from = a.data() + entries[k].column * a.rows();
        const double by = scale * entries[k].value;
        for (Eigen::Index i = 0; i < sum.rows(); ++i) to[i] += by * from[i];
      }
    }
  }
  static void AddPlain(const SparseBlock& block, double scale, const Eigen::MatrixXd& a,
                       Eigen::MatrixXd& sum) {
    Add(block, scale, a, sum);
  }
  TACLINK_FOR_AVX2 static void AddAvx2(const SparseBlock& block, double scale, const Eigen::MatrixXd& a,
                                       Eigen::MatrixXd& sum) {
    Add(block, scale, a, sum);
  }

  Eigen::Index size_;
  std::vector<std::vector<Entry>> rows_;
};

// A block of a matrix of which the lower triangle is there.
void WriteBlock(const Eigen::SparseMatrix<double>& lower, Eigen::Index row, Eigen::Index column,
                Eigen::MatrixXd& block) {
  const Eigen::Index size = block.rows(), first = std::max(row, column) * size;
  block.setZero();
  for (Eigen::Index c = 0; c < size; ++c) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(lower, std::min(row, column) * size + c); it; ++it) {
      const Eigen::Index r = it.row() - first;
      if (r < 0 || r >= size) continue;
      (row < column ? block(c, r) : block(r, c)) = it.value();
      if (row == column) block(c, r) = it.value();
    }
  }
}

[[maybe_unused]] bool IsBlockTridiagonal(const Eigen::SparseMatrix<double>& lower, Eigen::Index block) {
  for (Eigen::Index c = 0; c < lower.cols(); ++c) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(lower, c); it; ++it) {
      if (it.row() / block > c / block + 1) return false;
    }
  }
  return true;
}

}  // namespace

BlockTridiagonal::Rows BlockTridiagonal::Rows::With(const Rows& other) const {
  if (count() == 0) return other;
  if (other.count() == 0) return *this;
  return {std::min(begin, other.begin), std::max(end, other.end)};
}

BlockTridiagonal::BlockTridiagonal(Eigen::Index block, Eigen::Index blocks)
    : block_(block),
      middle_(blocks / 2),
      inverse_(static_cast<size_t>(blocks), Eigen::MatrixXf(block, block)),
      carried_(static_cast<size_t>(blocks), Eigen::MatrixXf(block, block)) {}

template <typename Visit>
void BlockTridiagonal::ForEachInward(Visit visit) const {
  for (Eigen::Index i = 0; i < middle_; ++i) visit(i, i + 1);
  for (auto i = static_cast<Eigen::Index>(inverse_.size()) - 1; i > middle_; --i) visit(i, i - 1);
}

template <typename Visit>
void BlockTridiagonal::ForEachOutward(Visit visit) const {
  for (Eigen::Index i = middle_; i-- > 0;) visit(i, i + 1);
  for (Eigen::Index i = middle_ + 1; i < static_cast<Eigen::Index>(inverse_.size()); ++i) visit(i, i - 1);
}

bool BlockTridiagonal::Factorise(const Eigen::SparseMatrix<double>& lower) {
  const auto last = static_cast<Eigen::Index>(inverse_.size()) - 1;
  assert(lower.cols() == block_ * (last + 1) && IsBlockTridiagonal(lower, block_));
  Eigen::MatrixXd schur(block_, block_), carried(block_, block_);  // S_i, C_i, and C_i'
  Eigen::MatrixXd carried_transposed(block_, block_);
  SparseBlock beside(block_);  // B(j, i)
  Eigen::MatrixXd middle(block_, block_);
  WriteBlock(lower, middle_, middle_, middle);
  bool is_regular = true;
  ForEachInward([&](Eigen::Index i, Eigen::Index j) {
    if (i == 0 || i == last) WriteBlock(lower, i, i, schur);
    is_regular = is_regular && dense::InvertSymmetric(schur);
    if (!is_regular) return;
    beside.Set(lower, j, i);
    carried_transposed.setZero();
    beside.AddTimesTransposed(1, schur, carried_transposed);
    carried = carried_transposed.transpose();
    inverse_[static_cast<size_t>(i)] = schur.cast<float>();
    carried_[static_cast<size_t>(i)] = carried.cast<float>();
    if (j != middle_) WriteBlock(lower, j, j, schur);
    beside.AddTimesTransposed(-1, carried, j == middle_ ? middle : schur);
  });
  if (!is_regular || !dense::InvertSymmetric(middle)) return false;
  inverse_[static_cast<size_t>(middle_)] = middle.cast<float>();
  return true;
}

void BlockTridiagonal::Solve(const Eigen::VectorXd& rhs, Eigen::VectorXd& x) const {
  assert(rhs.size() == block_ * static_cast<Eigen::Index>(inverse_.size()));
  Eigen::VectorXf all = rhs.cast<float>(), product(block_);
  const auto part = [&](Eigen::Index i) { return all.segment(i * block_, block_); };
  ForEachInward([&](Eigen::Index i, Eigen::Index j) {
    dense::Product(carried_[static_cast<size_t>(i)], part(i), product);
    part(j) -= product;
  });
  dense::Product(inverse_[static_cast<size_t>(middle_)], part(middle_), product);
  part(middle_) = product;
  ForEachOutward([&](Eigen::Index i, Eigen::Index j) {
    dense::Product(inverse_[static_cast<size_t>(i)], part(i), product);
    part(i) = product;
    dense::TransposedProduct(carried_[static_cast<size_t>(i)], part(j), product);
    part(i) -= product;
  });
  x = all.cast<double>();
}

void BlockTridiagonal::SolveRows(std::vector<Rows> filled, Eigen::MatrixXf& rows) const {
  assert(rows.cols() == block_ * static_cast<Eigen::Index>(inverse_.size()) &&
         filled.size() == inverse_.size());
  const auto part = [&](Eigen::Index i, const Rows& some) {
    return rows.block(some.begin, i * block_, some.count(), block_);
  };
  const Rows all{0, rows.rows()};
  ForEachInward([&](Eigen::Index i, Eigen::Index j) {
    const Rows& some = filled[static_cast<size_t>(i)];
    dense::AddProduct(-1.0F, part(i, some), carried_[static_cast<size_t>(i)], true, part(j, some));
    Rows& onto = filled[static_cast<size_t>(j)];
    onto = onto.With(some);
  });
  Eigen::MatrixXf right_side;  // of the block in work, before it is overwritten
  const auto add_own = [&](Eigen::Index i) {
    dense::AddProduct(1.0F, right_side, inverse_[static_cast<size_t>(i)], false,
                      part(i, filled[static_cast<size_t>(i)]));
  };
  right_side = part(middle_, filled[static_cast<size_t>(middle_)]);
  part(middle_, all).setZero();
  add_own(middle_);
  ForEachOutward([&](Eigen::Index i, Eigen::Index j) {
    right_side = part(i, filled[static_cast<size_t>(i)]);
    dense::SetProduct(-1.0F, part(j, all), carried_[static_cast<size_t>(i)], part(i, all));
    add_own(i);
  });
}

}  // namespace taclink
