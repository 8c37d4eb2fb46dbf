#include "sensing/shell/block_tridiagonal.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <cstdlib>

namespace taclink {
namespace {

constexpr Eigen::Index kBlock = 6;

// Symmetric, with blocks on the diagonal and beside it; definite where `shift` is large.
Eigen::MatrixXd Tridiagonal(Eigen::Index blocks, double shift) {
  const Eigen::Index size = kBlock * blocks;
  std::srand(3);  // Eigen's Random draws from it.
  const Eigen::MatrixXd any = Eigen::MatrixXd::Random(size, size);
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      if (i / kBlock - j / kBlock <= 1) matrix(i, j) = matrix(j, i) = any(i, j);
    }
    matrix(i, i) += shift;
  }
  return matrix;
}

Eigen::SparseMatrix<double> LowerOf(const Eigen::MatrixXd& matrix) {
  return Eigen::MatrixXd(matrix.triangularView<Eigen::Lower>()).sparseView();
}

// Of so many blocks, definite or not.
struct Shape {
  Eigen::Index blocks;
  double shift;
};
class BlockTridiagonalTest : public ::testing::TestWithParam<Shape> {
 protected:
  const Eigen::Index blocks_ = GetParam().blocks, size_ = kBlock * blocks_;
  const Eigen::MatrixXd matrix_ = Tridiagonal(blocks_, GetParam().shift);
};

TEST_P(BlockTridiagonalTest, SolutionsAreThoseOfADenseFactor) {
  BlockTridiagonal factor(kBlock, blocks_);
  // A factor of another matrix before leaves nothing behind.
  ASSERT_TRUE(factor.Factorise(LowerOf(Tridiagonal(blocks_, 50))));
  ASSERT_TRUE(factor.Factorise(LowerOf(matrix_)));
  const Eigen::VectorXd rhs = Eigen::VectorXd::Random(size_);
  Eigen::VectorXd x;
  factor.Solve(rhs, x);
  const Eigen::VectorXd expected = matrix_.inverse() * rhs;
  EXPECT_LT((x - expected).norm(), 1e-4 * expected.norm());
}

TEST_P(BlockTridiagonalTest, RowsAreSolvedTogether) {
  BlockTridiagonal factor(kBlock, blocks_);
  ASSERT_TRUE(factor.Factorise(LowerOf(matrix_)));
  // Rows reach one block, two, or none.
  constexpr Eigen::Index kRows = 10;
  std::vector<BlockTridiagonal::Rows> filled = {{0, 3}, {2, 5}, {}, {5, 8}, {7, 9}};
  filled.resize(static_cast<size_t>(blocks_));
  const Eigen::MatrixXf any = Eigen::MatrixXf::Random(kRows, size_);
  Eigen::MatrixXf rhs = Eigen::MatrixXf::Zero(kRows, size_);
  for (Eigen::Index block = 0; block < blocks_; ++block) {
    const auto& rows = filled[static_cast<size_t>(block)];
    rhs.block(rows.begin, block * kBlock, rows.count(), kBlock) =
        any.block(rows.begin, block * kBlock, rows.count(), kBlock);
  }
  const Eigen::MatrixXd expected = rhs.cast<double>() * matrix_.inverse();
  factor.SolveRows(filled, rhs);
  EXPECT_LT((rhs.cast<double>() - expected).norm(), 1e-4 * expected.norm());
}

INSTANTIATE_TEST_SUITE_P(DefiniteOrNot, BlockTridiagonalTest,
                         ::testing::Values(Shape{1, 20}, Shape{1, 0.3}, Shape{2, 20}, Shape{2, 0.3},
                                           Shape{4, 20}, Shape{4, 0.3}, Shape{5, 20}, Shape{5, 0.3}));

// In a block at an end, between, and in the middle.
TEST(BlockTridiagonalTest, WhatHasNoSolutionIsSaid) {
  BlockTridiagonal factor(kBlock, 5);
  for (const Eigen::Index row : {2, 9, 14, 27}) {
    Eigen::MatrixXd matrix = Tridiagonal(5, 20);
    matrix.row(row).setZero();
    matrix.col(row).setZero();
    EXPECT_FALSE(factor.Factorise(LowerOf(matrix))) << row;
    matrix = Tridiagonal(5, 20);
    matrix(row, row) = std::nan("");
    EXPECT_FALSE(factor.Factorise(LowerOf(matrix))) << row;
  }
}

}  // namespace
}  // namespace taclink
