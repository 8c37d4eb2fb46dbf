#include "sensing/camera/camera_shift.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "sensing/camera/projection.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

constexpr double kShiftNoisePx = 0.05, kShiftMouldMm = 0.1;

/// A link whose markers lie off the model's places, as a mould makes them, and the camera that was
/// calibrated.
class CameraShiftTest : public ::testing::Test {
 protected:
  CameraShiftTest() {
    for (Vec3& place : built_mm_)
      place += kShiftMouldMm * Vec3(normal_(random_), normal_(random_), normal_(random_));
  }

  // Of the built markers, against the model's places.
  std::vector<PointImage> Images(const CameraModel& camera) {
    const Projector projector(camera);
    std::vector<PointImage> images;
    for (size_t m = 0; m < built_mm_.size(); ++m) {
      const auto pixel = projector.Project(built_mm_[m]);
      if (pixel)
        images.push_back({markers_mm_[m], *pixel + kShiftNoisePx * Vec2(normal_(random_), normal_(random_))});
    }
    return images;
  }
  CameraModel MovedBy(const Vec3& mm, const Vec3& rad) const {
    CameraStep step = CameraStep::Zero();
    step.head<3>() = rad;
    step.segment<3>(3) = mm;
    return Moved(camera_, step);
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  const CameraModel camera_ = model_.nominal_rig[CameraId::kTop];
  const std::vector<Vec3> markers_mm_ = model_.RestMarkers();
  std::vector<Vec3> built_mm_ = markers_mm_;
  std::mt19937 random_{5};
  std::normal_distribution<double> normal_;
};

TEST_F(CameraShiftTest, FindsHowFarACameraWasMoved) {
  for (const Vec3& mm : {Vec3(0.4, 0, 0), Vec3(0, -0.4, 0), Vec3(0.2, 0.2, 0.28)}) {
    const auto shift = FindCameraShift(camera_, Images(MovedBy(mm, Vec3::Zero())));
    ASSERT_TRUE(shift.has_value());
    EXPECT_NEAR(shift->moved_mm, mm.norm(), 0.1) << mm.transpose();
    EXPECT_LT(shift->moved_sigma_mm, 0.1);
    EXPECT_TRUE(IsLarge(*shift, model_)) << mm.transpose();
  }
}

TEST_F(CameraShiftTest, FindsHowFarACameraWasTurned) {
  const double turn_rad = RadFromDeg(0.3);
  const auto shift = FindCameraShift(camera_, Images(MovedBy(Vec3::Zero(), Vec3(0, 0, turn_rad))));
  ASSERT_TRUE(shift.has_value());
  EXPECT_NEAR(shift->turned_rad, turn_rad, 0.2 * turn_rad);
  EXPECT_TRUE(IsLarge(*shift, model_));
}

TEST_F(CameraShiftTest, OneThatStayedHasNotMoved) {
  const auto shift = FindCameraShift(camera_, Images(camera_));
  ASSERT_TRUE(shift.has_value());
  EXPECT_LT(shift->moved_mm, 0.1);
  EXPECT_FALSE(IsLarge(*shift, model_));
}

TEST_F(CameraShiftTest, FewPointsTellNothing) {
  auto images = Images(camera_);
  images.resize(10);
  EXPECT_FALSE(FindCameraShift(camera_, images).has_value());
}

}  // namespace
}  // namespace taclink
