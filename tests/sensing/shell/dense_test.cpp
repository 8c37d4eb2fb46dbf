#include "sensing/shell/dense.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <cstdlib>

namespace taclink {
namespace {

constexpr Eigen::Index kRows = 60;

class Dense : public ::testing::Test {
 protected:
  static Eigen::MatrixXd PositiveDefinite() {
    const Eigen::MatrixXd a = Eigen::MatrixXd::Random(kRows, 2 * kRows);
    return a * a.transpose();
  }
  template <typename Matrix>
  static typename Matrix::PlainObject LowerOf(const Matrix& a) {
    return a.template triangularView<Eigen::Lower>();
  }
  template <typename Matrix>
  static typename Matrix::PlainObject AboveOf(const Matrix& a) {
    return a.template triangularView<Eigen::StrictlyUpper>();
  }
  static void ExpectClose(const Eigen::MatrixXd& found, const Eigen::MatrixXd& expected,
                          double tolerance = 1e-12) {
    ASSERT_EQ(found.rows(), expected.rows());
    ASSERT_EQ(found.cols(), expected.cols());
    EXPECT_LT((found - expected).norm(), tolerance * expected.norm());
  }
  static void ExpectClose(const Eigen::MatrixXf& found, const Eigen::MatrixXd& expected,
                          double tolerance = 1e-5) {
    ExpectClose(Eigen::MatrixXd(found.cast<double>()), expected, tolerance);
  }

  void SetUp() override { std::srand(5); }  // Eigen's Random draws from it.
};

TEST_F(Dense, CholeskyIsEigens) {
  const Eigen::MatrixXd a = PositiveDefinite();
  Eigen::MatrixXd l = a;
  ASSERT_TRUE(dense::Cholesky(l));
  ExpectClose(LowerOf(l), a.llt().matrixL());
  EXPECT_EQ(AboveOf(l), AboveOf(a));  // as promised, not touched
}

TEST_F(Dense, CholeskyReadsTheLowerHalfAlone) {
  const Eigen::MatrixXd a = PositiveDefinite();
  Eigen::MatrixXd l = LowerOf(a);
  ASSERT_TRUE(dense::Cholesky(l));
  ExpectClose(l, a.llt().matrixL());
}

TEST_F(Dense, CholeskySaysWhatIsNotPositiveDefinite) {
  Eigen::MatrixXd a = PositiveDefinite();
  a(40, 40) = -1;
  EXPECT_FALSE(dense::Cholesky(a));
}

// One column and several take different routines.
TEST_F(Dense, TriangularSolutionsAreEigens) {
  const Eigen::MatrixXd l = PositiveDefinite().llt().matrixL();
  for (const Eigen::Index columns : {1, 7}) {
    const Eigen::MatrixXd b = Eigen::MatrixXd::Random(kRows, columns);
    Eigen::MatrixXf forward = b.cast<float>(), backward = forward;
    dense::SolveLower(l.cast<float>(), forward);
    dense::SolveLowerTransposed(l.cast<float>(), backward);
    ExpectClose(forward, l.triangularView<Eigen::Lower>().solve(b));
    ExpectClose(backward, l.transpose().triangularView<Eigen::Upper>().solve(b));
  }
}

// A block of a larger matrix, whose columns are further apart than they are long; nothing else may change.
TEST_F(Dense, TriangularSolutionsOfABlock) {
  const Eigen::MatrixXd l = PositiveDefinite().llt().matrixL();
  const Eigen::MatrixXd before = Eigen::MatrixXd::Random(kRows + 11, 9);
  Eigen::MatrixXf forward = before.cast<float>();
  dense::SolveLower(l.cast<float>(), forward.block(4, 2, kRows, 3));
  Eigen::MatrixXd expected = before;
  expected.block(4, 2, kRows, 3) = l.triangularView<Eigen::Lower>().solve(before.block(4, 2, kRows, 3));
  ExpectClose(forward, expected);
  EXPECT_EQ(forward.topRows(4), before.topRows(4).cast<float>());
}

// What is above a factor's diagonal is left over from before the factorization and must not count.
TEST_F(Dense, TriangularSolutionsIgnoreTheUpperHalf) {
  const Eigen::MatrixXd a = PositiveDefinite();
  const Eigen::VectorXd b = Eigen::VectorXd::Random(kRows);
  Eigen::MatrixXd factor = a;
  ASSERT_TRUE(dense::Cholesky(factor));
  const Eigen::MatrixXf l = factor.cast<float>();
  Eigen::MatrixXf x = b.cast<float>();
  dense::SolveLower(l, x);
  dense::SolveLowerTransposed(l, x);
  ExpectClose(x, a.llt().solve(b), 1e-4);
}

TEST_F(Dense, AddOuterAddsToTheLowerHalf) {
  const Eigen::MatrixXf a = Eigen::MatrixXf::Random(kRows, 13), c = Eigen::MatrixXf::Random(kRows, kRows);
  Eigen::MatrixXf sum = c;
  dense::AddOuter(a, sum);
  ExpectClose(LowerOf(sum), LowerOf(Eigen::MatrixXf(c + a * a.transpose())).cast<double>());
  EXPECT_EQ(AboveOf(sum), AboveOf(c));
}

TEST_F(Dense, GramIsTheLowerHalfOfTheProduct) {
  const Eigen::MatrixXf a = Eigen::MatrixXf::Random(kRows, 13);
  Eigen::MatrixXf c;
  dense::Gram(a, c);
  ExpectClose(LowerOf(c), LowerOf(a.transpose() * a).cast<double>());
  // What a matrix of the right size held before does not count, not even if it is no number.
  c.setConstant(std::nanf(""));
  dense::Gram(a, c);
  ExpectClose(LowerOf(c), LowerOf(a.transpose() * a).cast<double>());
}

TEST_F(Dense, TransposedProductIsEigens) {
  const Eigen::MatrixXd a = Eigen::MatrixXd::Random(kRows, 13), b = Eigen::MatrixXd::Random(kRows, 5);
  Eigen::MatrixXd c;
  dense::TransposedProduct(a, b, c);
  ExpectClose(c, a.transpose() * b);
  c.setConstant(std::nan(""));
  dense::TransposedProduct(a, b, c);
  ExpectClose(c, a.transpose() * b);
  Eigen::MatrixXf single = Eigen::MatrixXf::Constant(13, 5, std::nanf(""));
  dense::TransposedProduct(a.cast<float>(), b.cast<float>(), single);
  ExpectClose(single, a.transpose() * b);
  dense::AddTransposedProduct(-3, a.cast<float>(), b.cast<float>(), single);
  ExpectClose(single, -2 * a.transpose() * b);
}

TEST_F(Dense, ProductsWithAVectorAreEigens) {
  const Eigen::MatrixXd a = Eigen::MatrixXd::Random(kRows, 13);
  const Eigen::VectorXd x = Eigen::VectorXd::Random(13), z = Eigen::VectorXd::Random(kRows);
  // What the result held before does not count.
  const Eigen::MatrixXf single = a.cast<float>();
  Eigen::VectorXf forward = Eigen::VectorXf::Constant(kRows, std::nanf("")), back = forward.head(13);
  dense::Product(single, x.cast<float>(), forward);
  EXPECT_LT((forward.cast<double>() - a * x).norm(), 1e-5 * (a * x).norm());
  dense::TransposedProduct(single, z.cast<float>(), back);
  EXPECT_LT((back.cast<double>() - a.transpose() * z).norm(), 1e-5 * (a.transpose() * z).norm());
  dense::Product(Eigen::MatrixXf(kRows, 0), Eigen::VectorXf(0), forward);
  EXPECT_TRUE(forward.isZero());
}

TEST_F(Dense, AddProductIsEigensOnBlocksToo) {
  const Eigen::MatrixXd a = Eigen::MatrixXd::Random(9, 13), b = Eigen::MatrixXd::Random(13, 5);
  const Eigen::MatrixXd before = Eigen::MatrixXd::Random(20, 11);
  Eigen::MatrixXd c = before, expected = before;
  dense::AddProduct(-2, a, b, false, c.block(3, 2, 9, 5));
  dense::AddProduct(0.5, a, b.transpose().eval(), true, c.block(3, 2, 9, 5));
  expected.block(3, 2, 9, 5) -= 1.5 * a * b;
  ExpectClose(c, expected);
  Eigen::MatrixXf single = before.cast<float>();
  dense::AddProduct(-1.5F, a.cast<float>().eval(), b.cast<float>().eval(), false, single.block(3, 2, 9, 5));
  ExpectClose(single, expected);
  expected.block(3, 2, 9, 5) = 2 * a * b;
  dense::SetProduct(2, a.cast<float>().eval(), b.cast<float>().eval(), single.block(3, 2, 9, 5));
  ExpectClose(single, expected);
}

TEST_F(Dense, SymmetricInversesOfDefiniteAndIndefinite) {
  for (const double shift : {0.0, 80.0}) {
    Eigen::MatrixXd a = PositiveDefinite();
    a.diagonal().array() -= shift;
    Eigen::MatrixXd inverse = a;
    ASSERT_TRUE(dense::InvertSymmetric(inverse));
    EXPECT_LT((a * inverse - Eigen::MatrixXd::Identity(kRows, kRows)).norm(), 1e-8);
  }
  Eigen::MatrixXd singular = Eigen::MatrixXd::Zero(kRows, kRows);
  EXPECT_FALSE(dense::InvertSymmetric(singular));
}

TEST_F(Dense, EmptyMatricesAreNoError) {
  Eigen::MatrixXd empty(0, 0);
  Eigen::MatrixXf no_columns(kRows, 0), c;
  EXPECT_TRUE(dense::Cholesky(empty));
  dense::Gram(no_columns, c);
  EXPECT_EQ(c.size(), 0);
  const Eigen::MatrixXf l = PositiveDefinite().llt().matrixL().toDenseMatrix().cast<float>();
  dense::SolveLower(l, no_columns);
  Eigen::MatrixXf same = l;
  dense::AddOuter(no_columns, same);
  EXPECT_EQ(same, l);
}

}  // namespace
}  // namespace taclink
