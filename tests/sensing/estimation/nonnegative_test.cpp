#include "sensing/estimation/nonnegative.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace taclink {
namespace {

// Minimum: the gradient vanishes where x is above zero and points outward where it is zero (Karush, Kuhn and
// Tucker).
void ExpectMinimum(const Eigen::MatrixXd& h, const Eigen::VectorXd& b, const Eigen::VectorXd& x) {
  const Eigen::VectorXd gradient = h * x - b;
  const double scale = b.cwiseAbs().maxCoeff();
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    EXPECT_GE(x[i], 0) << i;
    if (x[i] > 0)
      EXPECT_NEAR(gradient[i] / scale, 0, 1e-6) << i;
    else
      EXPECT_GE(gradient[i] / scale, -1e-6) << i;
  }
}

struct Problem {
  Eigen::MatrixXd h;
  Eigen::VectorXd b;
};

// Neighboring columns nearly alike, as those of loads on a skin.
Problem Smooth(unsigned seed, int variables) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd columns(2 * variables, variables);
  for (int j = 0; j < variables; ++j) {
    for (int i = 0; i < columns.rows(); ++i) columns(i, j) = std::exp(-0.005 * (i - 2 * j) * (i - 2 * j));
  }
  Eigen::VectorXd data(columns.rows());
  for (Eigen::Index i = 0; i < data.size(); ++i) data[i] = normal(random) + (i > 20 && i < 60 ? 5 : 0);
  return {columns.transpose() * columns, columns.transpose() * data};
}

TEST(NonNegativeSolver, FindsTheMinimum) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const auto [h, b] = Smooth(seed, 60);
    NonNegativeSolver solver;
    std::vector<int> support;
    ExpectMinimum(h, b, solver.Solve(h, b, support));
    EXPECT_TRUE(solver.converged());
  }
}

TEST(NonNegativeSolver, DoesNotDependOnWhereItStarts) {
  const auto [h, b] = Smooth(3, 60);
  NonNegativeSolver solver;
  std::vector<int> cold, warm = {1, 7, 20, 33, 58};
  const Eigen::VectorXd from_nothing = solver.Solve(h, b, cold);
  const Eigen::VectorXd from_others = solver.Solve(h, b, warm);
  EXPECT_LT((h * (from_nothing - from_others)).norm(), 1e-6 * b.norm());
}

TEST(NonNegativeSolver, SinglePrecisionIsAsGoodAMinimum) {
  const auto [h, b] = Smooth(3, 60);
  NonNegativeSolver solver;
  std::vector<int> exact, rounded;
  const Eigen::VectorXd x = solver.Solve(h, b, exact);
  const Eigen::VectorXd y = solver.Solve(Eigen::MatrixXf(h.cast<float>()), b, rounded);
  EXPECT_TRUE(solver.converged());
  EXPECT_GE(y.minCoeff(), 0);
  for (Eigen::Index i = 0; i < y.size(); ++i)
    EXPECT_EQ(y[i] > 0, std::count(rounded.begin(), rounded.end(), i) == 1) << i;
  const auto objective = [&](const Eigen::VectorXd& at) { return 0.5 * at.dot(h * at) - b.dot(at); };
  EXPECT_NEAR(objective(y), objective(x), 1e-3 * std::abs(objective(x)));
}

// Two that push and that the first leaves no room for: neither may wait for the other for ever.
TEST(NonNegativeSolver, WhatCannotComeInEndsTheSearch) {
  const Eigen::Matrix3d h{{1, 0.99, 0.99}, {0.99, 0.97, 0.96}, {0.99, 0.96, 0.97}};
  NonNegativeSolver solver;
  std::vector<int> support;
  const Eigen::VectorXd x = solver.Solve(Eigen::MatrixXd(h), Eigen::Vector3d(1.01, 1.005, 1.005), support);
  EXPECT_EQ(support, std::vector<int>{0});
  EXPECT_NEAR(x[0], 1.01, 1e-6);
}

TEST(NonNegativeSolver, NothingPushesNothingIsThere) {
  const Eigen::MatrixXd h = Eigen::MatrixXd::Identity(3, 3);
  NonNegativeSolver solver;
  std::vector<int> support;
  EXPECT_TRUE(solver.Solve(h, Eigen::Vector3d(-1, 0, -2), support).isZero());
  EXPECT_TRUE(support.empty());
}

}  // namespace
}  // namespace taclink
