// The markers' uncertainty against the thesis' formulas and against scattered images.
#include "sensing/design/resolution.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "sensing/camera/projection.h"
#include "sensing/camera/triangulation.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

constexpr double kSigmaPx = 0.3;

std::vector<MarkerResolution> ResolutionsOf(const LinkModel& model) {
  const SkinGeometry rest = RestGeometry(model);
  return FindResolution(model, rest, FindVisibility(model, rest), kSigmaPx);
}

// (4.18) and (4.19) for two pinholes on the axis, with independent errors of the radial coordinates.
TEST(Resolution, IsTheThesisOneOfPinholes) {
  LinkModel model = LoadLinkModel("cylinder").value();
  for (CameraModel& camera : model.nominal_rig.cameras) camera.lens.k1_per_px2 = camera.lens.k2_per_px4 = 0;
  const auto resolutions = ResolutionsOf(model);
  const double b1 = 26.5, b2 = 226.49, f1 = 226.91, f2 = 226.54, base = b1 + b2, radius = 36.5;
  for (int ring = 2; ring < 8; ++ring) {  // the outer rings are beyond the image without distortion
    const double z = 18.0 * (ring + 1);
    const double z_by_r2 = (b2 - z) * (b2 - z) * (b1 + z) / (f2 * base * radius);
    const double z_by_r1 = (b2 - z) * (b1 + z) * (b1 + z) / (f1 * base * radius);
    const double r_by_r1 = (b1 + z) * (b1 + z) / (f1 * base), r_by_r2 = (b2 - z) * (b2 - z) / (f2 * base);
    const auto& sigmas = resolutions[static_cast<size_t>(model.MarkerIndex(7, ring))].sigmas_mm;
    ASSERT_TRUE(sigmas) << ring;
    EXPECT_NEAR(sigmas->x(), kSigmaPx * std::hypot(r_by_r1, r_by_r2), 1e-3) << ring;
    EXPECT_NEAR(sigmas->z(), kSigmaPx * std::hypot(z_by_r1, z_by_r2), 1e-3) << ring;
  }
}

// Where rays through noisy pixels meet: another way of triangulation, of a lens with distortion.
TEST(Resolution, IsTheScatterOfNoisyImages) {
  const LinkModel model = LoadLinkModel("bottle").value();
  const auto resolutions = ResolutionsOf(model);
  const SkinGeometry rest = RestGeometry(model);
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, kSigmaPx);
  const Projector top(model.nominal_rig[CameraId::kTop]), bottom(model.nominal_rig[CameraId::kBottom]);
  for (const int ring : {0, 4, 9}) {
    const auto m = static_cast<size_t>(model.MarkerIndex(4, ring));
    const Vec3& at = rest.feet[m];
    const Vec3 out(at.x() / at.head<2>().norm(), at.y() / at.head<2>().norm(), 0);
    double r2 = 0, z2 = 0;
    constexpr int kTimes = 2000;
    for (int i = 0; i < kTimes; ++i) {
      const auto ray = [&](const Projector& camera) {
        const Vec2 pixel = *camera.Project(at) + Vec2(noise(random), noise(random));
        return SightRay{camera.center_in_link(), *camera.Ray(pixel)};
      };
      const SightRay a = ray(top), b = ray(bottom);
      const auto met = MeetRays(a, b);
      ASSERT_TRUE(met);
      r2 += std::pow((met->point_mm - at).dot(out), 2);
      z2 += std::pow((met->point_mm - at).z(), 2);
    }
    ASSERT_TRUE(resolutions[m].sigmas_mm);
    EXPECT_NEAR(std::sqrt(z2 / kTimes) / resolutions[m].sigmas_mm->z(), 1, 0.12) << ring;
    EXPECT_NEAR(std::sqrt(r2 / kTimes) / resolutions[m].sigmas_mm->x(), 1, 0.12) << ring;
  }
}

TEST(Resolution, OneCameraTellsNoDepth) {
  LinkModel model = LoadLinkModel("cylinder").value();
  model.nominal_rig[CameraId::kBottom].lens = {.focal_px = 1e5,
                                               .principal_point_px = Vec2(320, 240)};  // sees none
  for (const MarkerResolution& marker : ResolutionsOf(model)) {
    EXPECT_FALSE(marker.sigmas_mm);
    EXPECT_NEAR(marker.information.determinant(), 0, 1e-6 * std::pow(marker.information.trace(), 3));
    EXPECT_GT(marker.information.trace(), 0);
  }
}

}  // namespace
}  // namespace taclink
