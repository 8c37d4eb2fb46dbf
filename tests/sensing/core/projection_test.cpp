#include "sensing/camera/projection.h"

#include <gtest/gtest.h>

#include "sensing/model/model_file.h"

namespace taclink {
namespace {

class ProjectionTest : public ::testing::TestWithParam<std::string> {
 protected:
  LinkModel model_ = LoadLinkModel(GetParam()).value();
};

TEST_P(ProjectionTest, RayGoesThroughTheProjectedPoint) {
  for (const CameraId id : kBothCameras) {
    const Projector camera(model_.nominal_rig[id]);
    for (const Vec3& p : model_.RestMarkers()) {
      const auto pixel = camera.Project(p);
      ASSERT_TRUE(pixel.has_value());
      const auto ray = camera.Ray(*pixel);
      ASSERT_TRUE(ray.has_value());
      EXPECT_NEAR(((p - camera.center_in_link()).normalized() - *ray).norm(), 0, 1e-8);
    }
  }
}

TEST_P(ProjectionTest, JacobianIsTheDerivative) {
  for (const CameraId id : kBothCameras) {
    CameraModel tilted = model_.nominal_rig[id];
    tilted.camera_from_link.rotation =
        Mat3(Eigen::AngleAxisd(0.05, Vec3(1, -2, 0.5).normalized())) * tilted.camera_from_link.rotation;
    const Projector camera(tilted);
    for (const Vec3& p : model_.RestMarkers()) {
      const auto with = camera.ProjectWithJacobian(p);
      ASSERT_TRUE(with.has_value());
      for (int axis = 0; axis < 3; ++axis) {
        const double h = 1e-4;
        const Vec3 step = h * Vec3::Unit(axis);
        const Vec2 numeric = (*camera.Project(p + step) - *camera.Project(p - step)) / (2 * h);
        EXPECT_NEAR((with->jacobian.col(axis) - numeric).norm(), 0, 1e-5 * (1 + numeric.norm()));
      }
    }
  }
}

TEST_P(ProjectionTest, BothPicturesTurnAsSeenByTheCameras) {
  // +X is right in the top picture and left in the bottom one, which looks back; +Y is down in both.
  const double z = model_.length_mm / 2;
  const Projector top(model_.nominal_rig[CameraId::kTop]), bottom(model_.nominal_rig[CameraId::kBottom]);
  const Vec2 c_top = top.model().lens.principal_point_px, c_bottom = bottom.model().lens.principal_point_px;
  EXPECT_GT(top.Project({30, 0, z})->x(), c_top.x());
  EXPECT_LT(bottom.Project({30, 0, z})->x(), c_bottom.x());
  EXPECT_GT(top.Project({0, 30, z})->y(), c_top.y());
  EXPECT_GT(bottom.Project({0, 30, z})->y(), c_bottom.y());
}

INSTANTIATE_TEST_SUITE_P(ShippedModels, ProjectionTest, ::testing::Values("cylinder", "barrel"));

TEST(Projection, BehindTheCameraIsRefused) {
  const Projector camera(LoadLinkModel("cylinder")->nominal_rig[CameraId::kTop]);
  EXPECT_FALSE(camera.Project({10, 0, -300}).has_value());
}

}  // namespace
}  // namespace taclink
