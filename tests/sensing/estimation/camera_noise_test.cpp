#include "sensing/estimation/camera_noise.h"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <cmath>
#include <limits>
#include <random>

namespace taclink {
namespace {

constexpr double kUnseenMm = 30;

// Of two cameras' rays, of one's, and of none: directions of every orientation.
TEST(CameraNoise, ShortcutsAreTheEigenvalues) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  int surely = 0;
  for (int i = 0; i < 3000; ++i) {
    Mat3 root;
    for (double& number : root.reshaped()) number = normal(random);
    const Vec3 sizes(1e4, 1e3 * (i % 2), i % 3 == 0 ? 1e-4 : 30.0 * (i % 5));
    const Eigen::HouseholderQR<Mat3> qr(root);
    const Mat3 turn = qr.householderQ();
    const Mat3 information = turn * sizes.asDiagonal() * turn.transpose();
    const Vec3 variances = sizes.cwiseMax(1 / (kUnseenMm * kUnseenMm)).cwiseInverse();
    EXPECT_NEAR(NoiseTraceOf(information, kUnseenMm), variances.sum(), 1e-6 * variances.sum());
    EXPECT_NEAR(NoiseOf(information, kUnseenMm).trace(), variances.sum(), 1e-6 * variances.sum());
    const bool is_surely_seen = IsSurelySeen(information, 1e-2);
    EXPECT_TRUE(!is_surely_seen || sizes.minCoeff() > 1e-2) << sizes.transpose();
    surely += is_surely_seen;
  }
  EXPECT_GT(surely, 500);
}

TEST(CameraNoise, NumbersThatAreNoneAreNotSeen) {
  Mat3 information = Mat3::Identity();
  information(1, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(IsSurelySeen(information, 1e-2));
  EXPECT_DOUBLE_EQ(NoiseTraceOf(information, kUnseenMm), 3 * kUnseenMm * kUnseenMm);
  EXPECT_FALSE(IsSurelySeen(Mat3::Zero(), 1e-2));
}

}  // namespace
}  // namespace taclink
