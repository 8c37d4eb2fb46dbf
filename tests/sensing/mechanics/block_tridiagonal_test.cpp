#include "sensing/mechanics/block_tridiagonal.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <cstdlib>

namespace taclink {
namespace {

constexpr Eigen::Index kBlock = 6, kBlocks = 5, kSize = kBlock * kBlocks;

// Symmetric, with blocks on the diagonal and beside it; definite where `shift` is large.
Eigen::MatrixXd Tridiagonal(double shift) {
  std::srand(3);  // Eigen's Random draws from it.
  const Eigen::MatrixXd any = Eigen::MatrixXd::Random(kSize, kSize);
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(kSize, kSize);
  for (Eigen::Index i = 0; i < kSize; ++i) {
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

class BlockTridiagonalTest : public testing::TestWithParam<double> {};

TEST_P(BlockTridiagonalTest, SolutionsAreThoseOfADenseFactor) {
  const Eigen::MatrixXd matrix = Tridiagonal(GetParam());
  BlockTridiagonal factor(kBlock, kBlocks);
  // A factor of another matrix before leaves nothing behind.
  ASSERT_TRUE(factor.Factorise(LowerOf(Tridiagonal(50))));
  ASSERT_TRUE(factor.Factorise(LowerOf(matrix)));
  const Eigen::VectorXd rhs = Eigen::VectorXd::Random(kSize);
  Eigen::VectorXd x;
  factor.Solve(rhs, x);
  const Eigen::VectorXd expected = matrix.inverse() * rhs;
  EXPECT_LT((x - expected).norm(), 1e-4 * expected.norm());
}

TEST_P(BlockTridiagonalTest, RowsAreSolvedTogether) {
  const Eigen::MatrixXd matrix = Tridiagonal(GetParam());
  BlockTridiagonal factor(kBlock, kBlocks);
  ASSERT_TRUE(factor.Factorise(LowerOf(matrix)));
  // Rows reach one block, two, or none.
  constexpr Eigen::Index kRows = 10;
  const std::vector<BlockTridiagonal::Rows> filled = {{0, 3}, {2, 5}, {}, {5, 8}, {7, 9}};
  const Eigen::MatrixXf any = Eigen::MatrixXf::Random(kRows, kSize);
  Eigen::MatrixXf rhs = Eigen::MatrixXf::Zero(kRows, kSize);
  for (Eigen::Index block = 0; block < kBlocks; ++block) {
    const auto& rows = filled[static_cast<size_t>(block)];
    rhs.block(rows.begin, block * kBlock, rows.count(), kBlock) =
        any.block(rows.begin, block * kBlock, rows.count(), kBlock);
  }
  const Eigen::MatrixXd expected = rhs.cast<double>() * matrix.inverse();
  Eigen::MatrixXf x;
  factor.SolveRows(rhs, filled, x);
  EXPECT_LT((x.cast<double>() - expected).norm(), 1e-4 * expected.norm());
}

INSTANTIATE_TEST_SUITE_P(DefiniteOrNot, BlockTridiagonalTest, testing::Values(20.0, 0.3));

TEST(BlockTridiagonalTest, WhatHasNoSolutionIsSaid) {
  BlockTridiagonal factor(kBlock, kBlocks);
  Eigen::MatrixXd matrix = Tridiagonal(20);
  matrix.row(9).setZero();
  matrix.col(9).setZero();
  EXPECT_FALSE(factor.Factorise(LowerOf(matrix)));
  matrix = Tridiagonal(20);
  matrix(14, 14) = std::nan("");
  EXPECT_FALSE(factor.Factorise(LowerOf(matrix)));
}

}  // namespace
}  // namespace taclink
