#include "sensing/shell/rigid_body.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace taclink {
namespace {

const RigidStamp kStamp{{1, -2, 3}, Vec3(1, 2, -0.5).normalized(), 4.5, 2};

// `out` mm from the axis and `up` mm above the face.
Vec3 Beside(double out, double up) {
  return kStamp.face_center_mm + up * kStamp.axis + out * kStamp.axis.unitOrthogonal();
}

TEST(RigidStamp, RimIsRoundAndThenACone) {
  EXPECT_NEAR(GapOf(kStamp, Beside(2.4, 0.3)).distance_mm, 0.3, 1e-12);
  const double center = kStamp.radius_mm - kStamp.rim_radius_mm;
  for (const double degrees : {0.0, 20.0, 45.0, 60.0}) {
    const double angle = RadFromDeg(degrees);
    const Vec3 on_rim = Beside(center + 2 * std::sin(angle), -2 * (1 - std::cos(angle)));
    const Gap gap = GapOf(kStamp, on_rim);
    EXPECT_NEAR(gap.distance_mm, 0, 1e-12) << degrees;
    EXPECT_NEAR(gap.normal.normalized().dot(kStamp.axis), std::cos(angle), 1e-12) << degrees;
  }
  const double edge = center + 2 * std::sin(kPi / 3);
  EXPECT_NEAR(GapOf(kStamp, Beside(edge + 1, -1)).distance_mm, std::sqrt(3.0), 1e-12);
}

// Above, on and behind the face, out to the cone.
TEST(RigidStamp, GradientAndCurvatureAreTheDerivatives) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> within(-6, 6);
  constexpr double kStep = 1e-5;
  for (int i = 0; i < 200; ++i) {
    const double x = within(random), y = within(random), z = within(random);
    const Vec3 p = kStamp.face_center_mm + Vec3(x, y, z);
    const Gap gap = GapOf(kStamp, p);
    Vec3 gradient;
    Mat3 curvature;
    for (int axis = 0; axis < 3; ++axis) {
      const Gap ahead = GapOf(kStamp, p + kStep * Vec3::Unit(axis));
      const Gap behind = GapOf(kStamp, p - kStep * Vec3::Unit(axis));
      gradient[axis] = (ahead.distance_mm - behind.distance_mm) / (2 * kStep);
      curvature.col(axis) = (ahead.normal - behind.normal) / (2 * kStep);
    }
    EXPECT_LT((gap.normal - gradient).norm(), 1e-6);
    EXPECT_LT((gap.curvature_per_mm - curvature).norm(), 1e-6 * (1 + curvature.norm()));
  }
}

TEST(RigidStamp, NothingBeyondReachCanBeInside) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> within(-1, 1);
  int beyond = 0;
  for (int i = 0; i < 20000; ++i) {
    const double x = within(random), y = within(random), z = within(random), reach = 2 + 2 * within(random);
    const Vec3 p = kStamp.face_center_mm + 15 * Vec3(x, y, z);
    if (!IsBeyondReach(kStamp, p, reach)) continue;
    ++beyond;
    const double u = within(random), v = within(random), w = within(random);
    const Vec3 near = p + reach * Vec3(u, v, w) / std::max(1.0, Vec3(u, v, w).norm());
    EXPECT_GT(GapOf(kStamp, near).distance_mm, 0);
  }
  EXPECT_GT(beyond, 1000);
}

}  // namespace
}  // namespace taclink
