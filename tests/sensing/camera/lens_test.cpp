#include "sensing/camera/lens.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "sensing/camera/projection.h"

namespace taclink {
namespace {

CameraModel Camera(LensKind kind) {
  CameraModel camera;
  camera.width_px = 640;
  camera.height_px = 480;
  camera.lens = {226.9, Vec2(322.8, 225.2), 2.785e-6, -1.409e-11};
  if (kind == LensKind::kKannalaBrandt) {
    camera.lens = {.focal_px = 231,
                   .principal_point_px = Vec2(318, 243),
                   .kind = kind,
                   .fisheye_k = {0.02, -0.011, 0.004, -0.0007}};
  }
  camera.camera_from_link.rotation = Eigen::AngleAxisd(0.2, Vec3(1, -2, 0.5).normalized());
  camera.camera_from_link.translation = Vec3(3, -2, 26);
  return camera;
}

// Points all over the view, from the axis to 70 degrees off it.
std::vector<Vec3> Points(const CameraModel& camera) {
  std::vector<Vec3> points;
  for (int i = 0; i < 60; ++i) {
    const double theta = RadFromDeg(70.0 * i / 59), phi = 2.4 * i, distance = 20 + 5 * i;
    const Vec3 p =
        distance * Vec3(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta));
    points.push_back(camera.camera_from_link.Inverse() * p);
  }
  return points;
}

class LensTest : public ::testing::TestWithParam<LensKind> {
 protected:
  const CameraModel camera_ = Camera(GetParam());
};

TEST_P(LensTest, RayGoesBackToThePoint) {
  const Projector projector(camera_);
  for (const Vec3& p : Points(camera_)) {
    const auto pixel = projector.Project(p);
    ASSERT_TRUE(pixel);
    const auto ray = projector.Ray(*pixel);
    ASSERT_TRUE(ray);
    EXPECT_LT(((p - projector.center_in_link()).normalized() - *ray).norm(), 1e-9);
  }
}

TEST_P(LensTest, JacobianByThePointIsTheDerivative) {
  const Projector projector(camera_);
  for (const Vec3& p : Points(camera_)) {
    const auto analytic = projector.ProjectWithCameraJacobian(p);
    ASSERT_TRUE(analytic);
    EXPECT_LT((analytic->pixel - *projector.Project(p)).norm(), 1e-9);
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3 step = 1e-4 * Vec3::Unit(axis);
      const Vec2 numeric = (*projector.Project(p + step) - *projector.Project(p - step)) / 2e-4;
      EXPECT_LT((analytic->by_point.col(axis) - numeric).norm(), 1e-5);
      EXPECT_LT((projector.ProjectWithJacobian(p)->jacobian.col(axis) - numeric).norm(), 1e-5);
    }
  }
}

TEST_P(LensTest, JacobianByTheCameraIsTheDerivative) {
  const Projector projector(camera_);
  CameraStep sizes;
  sizes << Vec3::Constant(1e-5), Vec3::Constant(1e-4), Vec2::Constant(1e-3), 1e-3,
      Eigen::Vector4d::Constant(1e-6);
  if (GetParam() == LensKind::kDivision) sizes.tail<4>() << 1e-9, 1e-14, 1, 1;
  for (const Vec3& p : Points(camera_)) {
    const auto analytic = projector.ProjectWithCameraJacobian(p);
    ASSERT_TRUE(analytic);
    for (int i = 0; i < kCameraParameters; ++i) {
      const CameraStep step = sizes[i] * CameraStep::Unit(i);
      const auto plus = Projector(Moved(camera_, step)).Project(p),
                 minus = Projector(Moved(camera_, -step)).Project(p);
      const Vec2 numeric = 0.5 * (*plus - *minus);
      EXPECT_LT((sizes[i] * analytic->by_camera.col(i) - numeric).norm(), 1e-11 + 1e-5 * numeric.norm())
          << "parameter " << i;
    }
  }
}

TEST_P(LensTest, StepsAreUndone) {
  CameraStep step;
  step << 0.02, -0.03, 0.05, 1, -2, 0.5, 4, -3, 2, 1e-7, 1e-12, 0, 0;
  EXPECT_LT((StepBetween(camera_, Moved(camera_, step)) - step).norm(), 1e-9);
}

TEST_P(LensTest, AngleAndRadiusRiseTogetherToTheLimit) {
  const Lens lens(camera_.lens, 400);
  double before = -1;
  for (double theta = 0; theta < lens.max_theta_rad(); theta += 0.01) {
    const auto radius = lens.AtAngle(theta);
    ASSERT_TRUE(radius);
    EXPECT_GT(radius->px, before);
    EXPECT_NEAR(*lens.AngleAt(radius->px), theta, 1e-10);
    before = radius->px;
  }
  EXPECT_FALSE(lens.AtAngle(lens.max_theta_rad() + 0.01));
  EXPECT_FALSE(lens.AngleAt(1e6));
  EXPECT_FALSE(lens.AtPoint(std::nan(""), 1));
  EXPECT_FALSE(lens.AtPoint(0, 0));
}

TEST_P(LensTest, OtherKindsCanStandInForIt) {
  const LensKind other = GetParam() == LensKind::kDivision ? LensKind::kKannalaBrandt : LensKind::kDivision;
  const double widest = RadFromDeg(50);  // what a link fills
  const Lens a(camera_.lens, 400), b(ConvertLens(camera_.lens, other, widest), 400);
  for (double theta = 0.01; theta < widest; theta += 0.01)
    EXPECT_NEAR(a.AtAngle(theta)->px, b.AtAngle(theta)->px, 0.5);
}

INSTANTIATE_TEST_SUITE_P(Kinds, LensTest, ::testing::Values(LensKind::kDivision, LensKind::kKannalaBrandt),
                         [](const auto& one) { return std::string(Name(one.param)); });

TEST(Lens, DivisionIsTheEquationOfTheThesis) {
  const CameraModel camera = Camera(LensKind::kDivision);
  const Lens lens(camera.lens, 400);
  for (double r = 5; r < 250; r += 5) {
    const double pinhole =
        r / (1 + camera.lens.k1_per_px2 * r * r + camera.lens.k2_per_px4 * std::pow(r, 4));  // (4.41)
    EXPECT_NEAR(*lens.AngleAt(r), std::atan2(pinhole, camera.lens.focal_px), 1e-12);
    EXPECT_NEAR(lens.AtPoint(pinhole, camera.lens.focal_px)->px, r, 1e-8);
  }
}

TEST(Lens, KannalaBrandtIsThatOfOpenCv) {
  const CameraModel camera = Camera(LensKind::kKannalaBrandt);
  const auto& [f, c, k1, k2, kind, k] = camera.lens;
  const cv::Matx33d intrinsic(f, 0, c.x(), 0, f, c.y(), 0, 0, 1);
  const cv::Vec4d distortion(k[0], k[1], k[2], k[3]);
  const Projector projector(camera);
  for (const Vec3& p : Points(camera)) {
    const Vec3 q = camera.camera_from_link * p;
    std::vector<cv::Point2d> seen;
    cv::fisheye::projectPoints(std::vector<cv::Point3d>{{q.x(), q.y(), q.z()}}, seen, cv::Vec3d(0, 0, 0),
                               cv::Vec3d(0, 0, 0), intrinsic, distortion);
    EXPECT_LT((*projector.Project(p) - Vec2(seen[0].x, seen[0].y)).norm(), 1e-6);
  }
}

}  // namespace
}  // namespace taclink
