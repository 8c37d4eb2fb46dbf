#include "sensing/estimation/whitening.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cstdlib>
#include <limits>
#include <memory>

namespace taclink {
namespace {

constexpr Eigen::Index kRows = 42;

class WhiteningTest : public ::testing::Test {
 protected:
  WhiteningTest() {
    std::srand(5);  // of Eigen's Random
    const Eigen::MatrixXd random = Eigen::MatrixXd::Random(kRows, kRows);
    shared_ = random * random.transpose() + 0.5 * Eigen::MatrixXd::Identity(kRows, kRows);
    factored_ = std::make_shared<const DenseCovariance>(shared_);
  }
  // M' C M = I, M M' = C^-1 and products with C, by products in double.
  void Check(const Eigen::MatrixXd& random_columns) {
    const Eigen::MatrixXf single = random_columns.cast<float>();
    ASSERT_TRUE(whitening_.Set(factored_, single));
    const Eigen::MatrixXd columns = single.cast<double>();
    const Eigen::MatrixXd covariance = shared_ + columns * columns.transpose();
    const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(kRows, kRows);
    const Eigen::MatrixXd m = whitening_.Applied(identity);
    // Single precision, of the largest column.
    const double limit = std::max(1e-3, 5e-7 * static_cast<double>(single.norm()));
    EXPECT_LT((m * covariance * m.transpose() - identity).cwiseAbs().maxCoeff(), limit);
    const Eigen::VectorXd x = Eigen::VectorXd::Random(kRows);
    EXPECT_LT((whitening_.Applied(x) - m * x).norm(), 1e-5 * x.norm());
    const Eigen::VectorXd by_inverse = covariance.llt().solve(x);
    EXPECT_LT((whitening_.Transposed(m * x) - by_inverse).norm(), 1e-3 * by_inverse.norm());
    // Single precision, of what the largest column may make of it.
    EXPECT_LT((whitening_.Covariance(x) - covariance * x).norm(), 1e-5 * covariance.norm() * x.norm());
  }

  Eigen::MatrixXd shared_;
  std::shared_ptr<const DenseCovariance> factored_;
  Whitening whitening_;
};

TEST_F(WhiteningTest, IsOfTheSharedPartAlone) {
  Check(Eigen::MatrixXd(kRows, 0));
}

TEST_F(WhiteningTest, IsOfBothParts) {
  Check(Eigen::MatrixXd::Random(kRows, 7));
}

// As of the pressure, which is far larger than all else, and of stray forces side by side, which are nearly
// the same.
TEST_F(WhiteningTest, BearsLargeAndDependentColumns) {
  Eigen::MatrixXd columns = Eigen::MatrixXd::Random(kRows, 50);
  columns.col(0) *= 100;
  columns.col(2) = columns.col(1);
  Check(columns);
}

// Of shares whose columns are all but known: where I - U' C^-1 U would be rounding.
TEST_F(WhiteningTest, KnowsWhatIsLeftOfTheLastShares) {
  for (const double size : {1.0, 1e2, 1e4}) {
    Eigen::MatrixXd columns = Eigen::MatrixXd::Random(kRows, 9);
    columns.rightCols<1>() *= size;
    Check(columns);
    const Eigen::MatrixXd single = columns.cast<float>().cast<double>();
    for (const Eigen::Index count : {1, 4}) {
      const Eigen::MatrixXd others = single.leftCols(9 - count), last = single.rightCols(count);
      const Eigen::MatrixXd told =
          last.transpose() * (shared_ + others * others.transpose()).llt().solve(last);
      const Eigen::MatrixXd information = told + Eigen::MatrixXd::Identity(count, count);
      const Eigen::MatrixXd expected = information.llt().solve(Eigen::MatrixXd::Identity(count, count));
      const Eigen::VectorXd sigmas = expected.diagonal().cwiseSqrt();
      const Eigen::MatrixXd off = whitening_.LastPosterior(count) - expected;
      EXPECT_LT((sigmas.cwiseInverse().asDiagonal() * off * sigmas.cwiseInverse().asDiagonal()).norm(), 2e-2)
          << size << " " << count;
    }
  }
}

TEST_F(WhiteningTest, RefusesWhatIsNotFinite) {
  Eigen::MatrixXf columns = Eigen::MatrixXf::Ones(kRows, 1);
  columns(3, 0) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(whitening_.Set(factored_, columns));
}

}  // namespace
}  // namespace taclink
