#include "sensing/pipeline/view_obstruction.h"

#include <gtest/gtest.h>

#include "sensing/model/model_file.h"

namespace taclink {
namespace {

class ViewObstructionTest : public ::testing::Test {
 protected:
  static ImageResidual Residual(const Vec2& px) { return {.px = px, .sigmas = px.norm() / 0.05}; }
  ViewObstructionTest() {
    for (auto& camera : residuals_)
      camera.assign(static_cast<size_t>(model_.markers.count()), Residual({0.1, 0}));
  }
  void Displace(CameraId id, int ring, int paths, const Vec2& by_px) {
    for (int path = 3; path < 3 + paths; ++path)
      residuals_[Index(id)][static_cast<size_t>(model_.MarkerIndex(path, ring))] = Residual(by_px);
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  ImageResiduals residuals_;
};

TEST_F(ViewObstructionTest, MarkersThatOneCameraShowsDisplacedAreOne) {
  Displace(CameraId::kBottom, 5, 4, {0.6, 0});
  Displace(CameraId::kBottom, 6, 1, {0, -1.5});
  const auto found = FindViewObstruction(model_, residuals_);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->camera, CameraId::kBottom);
  EXPECT_EQ(found->markers, 5);
  EXPECT_EQ(found->marker, model_.MarkerIndex(3, 6));
  EXPECT_DOUBLE_EQ(found->most_px, 1.5);
}

TEST_F(ViewObstructionTest, AFewMarkersAreNone) {
  Displace(CameraId::kTop, 5, 3, {3, 0});
  EXPECT_FALSE(FindViewObstruction(model_, residuals_));
}

// A marker at the edge of what a camera can see scatters by pixels.
TEST_F(ViewObstructionTest, MarkersThatScatterByTheirOwnNoiseAreNone) {
  Displace(CameraId::kTop, 5, 8, {3, 0});
  for (auto& residual : residuals_[0]) residual->sigmas = residual->px.norm();
  EXPECT_FALSE(FindViewObstruction(model_, residuals_));
}

TEST_F(ViewObstructionTest, WhatBothCamerasShowIsNone) {
  for (const CameraId id : kBothCameras) Displace(id, 5, 8, {1, 0});
  EXPECT_FALSE(FindViewObstruction(model_, residuals_));
}

TEST_F(ViewObstructionTest, ACameraThatHasMovedIsNone) {
  for (auto& residual : residuals_[0]) residual = Residual({2, 0.3});
  EXPECT_FALSE(FindViewObstruction(model_, residuals_));
}

TEST_F(ViewObstructionTest, MarkersThatOneCameraDoesNotSeeDoNotCount) {
  Displace(CameraId::kTop, 5, 8, {1, 0});
  for (auto& residual : residuals_[1]) residual.reset();
  EXPECT_FALSE(FindViewObstruction(model_, residuals_));
  EXPECT_FALSE(FindViewObstruction(model_, {}));
}

}  // namespace
}  // namespace taclink
