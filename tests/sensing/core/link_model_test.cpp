#include "sensing/core/link_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace taclink {
namespace {

TEST(RadiusProfile, ArcGoesThroughItsThreePoints) {
  const auto arc = RadiusProfile::Arc(260, 36.28, 53.36);
  EXPECT_NEAR(arc.Radius(0), 36.28, 1e-9);
  EXPECT_NEAR(arc.Radius(130), 53.36, 1e-9);
  EXPECT_NEAR(arc.Radius(260), 36.28, 1e-9);
}

TEST(RadiusProfile, SlopeIsTheDerivative) {
  const std::vector<RadiusProfile> profiles = {
      RadiusProfile::Constant(30), RadiusProfile::Arc(260, 36, 53), RadiusProfile::Arc(260, 53, 36),
      RadiusProfile::Spline({{0, 30}, {50, 35}, {120, 33}, {200, 40}})};
  for (const auto& profile : profiles) {
    for (double z = 5; z < 195; z += 7) {
      const double h = 1e-5;
      EXPECT_NEAR(profile.Slope(z), (profile.Radius(z + h) - profile.Radius(z - h)) / (2 * h), 1e-7);
    }
  }
}

TEST(RadiusProfile, SplineInterpolatesItsPoints) {
  const auto spline = RadiusProfile::Spline({{0, 30}, {50, 35}, {120, 33}, {200, 40}});
  EXPECT_NEAR(spline.Radius(0), 30, 1e-12);
  EXPECT_NEAR(spline.Radius(50), 35, 1e-12);
  EXPECT_NEAR(spline.Radius(120), 33, 1e-12);
  EXPECT_NEAR(spline.Radius(200), 40, 1e-12);
}

TEST(LinkModel, NormalIsPerpendicularToTheSurface) {
  LinkModel model;
  model.profile = RadiusProfile::Arc(260, 36, 53);
  for (double z = 10; z < 250; z += 30) {
    const double h = 1e-5, a = 0.7;
    const Vec3 along_z = model.PointAtDepth(a, z + h, 0) - model.PointAtDepth(a, z - h, 0);
    const Vec3 around = model.PointAtDepth(a + h, z, 0) - model.PointAtDepth(a - h, z, 0);
    const Vec3 n = model.OutwardNormal(a, z);
    EXPECT_NEAR(n.norm(), 1, 1e-12);
    EXPECT_NEAR(n.dot(along_z.normalized()), 0, 1e-7);
    EXPECT_NEAR(n.dot(around.normalized()), 0, 1e-7);
    EXPECT_NEAR((model.PointAtDepth(a, z, 2) - model.PointAtDepth(a, z, 0)).dot(n), -2, 1e-12);
  }
}

}  // namespace
}  // namespace taclink
