#include "sensing/pipeline/rest_comparison.h"

#include <gtest/gtest.h>

#include <optional>
#include <random>

#include "sensing/model/model_file.h"
#include "tests/support/synthetic_markers.h"

namespace taclink {
namespace {

class RestComparisonTest : public ::testing::Test {
 protected:
  RestComparisonTest() { rest_.SetBaseline(See(Inflated(0), Inflated(0))); }

  LabelledMarkers See(const Motion& top, const Motion& bottom) {
    return LabelsOf(model_, top, bottom, kNoisePx, random_);
  }
  // `by_mm`: what the skin is expected to be inflated by.
  std::optional<CameraId> Alone(const Motion& top, const Motion& bottom, double by_mm = 0) {
    std::vector<Vec3> expected_mm;
    for (int m = 0; m < model_.markers.count(); ++m)
      expected_mm.push_back(Inflated(by_mm)(model_.RestMarker(m)) - model_.RestMarker(m));
    return rest_.SeesAlone(See(top, bottom), {expected_mm, expected_mm});
  }
  std::optional<CameraId> Alone(const Motion& both, double by_mm = 0) { return Alone(both, both, by_mm); }

  static Motion Inflated(double by_mm) {
    return [=](const Vec3& rest) -> Vec3 { return rest + by_mm * Vec3(rest.x(), rest.y(), 0).normalized(); };
  }
  Motion Dented(double depth_mm, double z_mm, double inflated_mm = 0) const {
    return [=, this](const Vec3& rest) {
      return Inflated(inflated_mm)(
          Deform(model_, {{.angle_rad = 1, .z_mm = z_mm, .depth_mm = depth_mm, .width_mm = 12}}, rest));
    };
  }

  static constexpr double kNoisePx = 0.07;
  const LinkModel model_ = LoadLinkModel("cylinder").value();
  RestComparison rest_{model_, model_.nominal_rig, kNoisePx};
  std::mt19937 random_{1};
};

TEST_F(RestComparisonTest, WhatBothSeeIsSaidOfNone) {
  EXPECT_EQ(Alone(Inflated(0)), std::nullopt);
  for (const double z_mm : {60.0, 90.0, 140.0}) {
    for (const double depth_mm : {0.5, 2.0, 8.0, -3.0}) {
      EXPECT_EQ(Alone(Dented(depth_mm, z_mm)), std::nullopt) << depth_mm << " at " << z_mm;
      EXPECT_EQ(Alone(Dented(depth_mm, z_mm, 4), 4), std::nullopt) << depth_mm << " at " << z_mm;
    }
  }
  EXPECT_EQ(Alone(Inflated(4), 3), std::nullopt) << "a wrong pressure is no disagreement";
  EXPECT_EQ(Alone(Inflated(4), 0), std::nullopt);
}

// Detections that tell a tenth of their noise.
TEST_F(RestComparisonTest, NoiseThatDetectionsDoNotTellIsNoMotion) {
  constexpr double kJitterPx = 0.3;
  RestComparison rest(model_, model_.nominal_rig, kJitterPx);
  const std::vector<Vec3> still(static_cast<size_t>(model_.markers.count()), Vec3::Zero());
  const auto see = [&] {
    LabelledMarkers seen = LabelsOf(model_, Inflated(0), Inflated(0), kJitterPx, random_);
    for (auto& camera : seen.cameras) {
      for (MarkerObservation& marker : camera) marker.covariance_px2 /= 100;
    }
    return seen;
  };
  rest.SetBaseline(see());
  for (int frame = 0; frame < 100; ++frame) EXPECT_EQ(rest.SeesAlone(see(), {still, still}), std::nullopt);
}

TEST_F(RestComparisonTest, WhatOneSeesIsSaid) {
  for (const double z_mm : {60.0, 90.0, 140.0}) {
    for (const double depth_mm : {1.0, 2.0, 8.0, -3.0}) {
      EXPECT_EQ(Alone(Dented(depth_mm, z_mm), Inflated(0)), CameraId::kTop) << depth_mm << " at " << z_mm;
      EXPECT_EQ(Alone(Inflated(3), Dented(depth_mm, z_mm, 3), 3), CameraId::kBottom)
          << depth_mm << " at " << z_mm;
    }
  }
  EXPECT_EQ(Alone(Inflated(4), Inflated(3), 4), CameraId::kBottom) << "of before the pressure rose";
}

TEST_F(RestComparisonTest, ADragIsSeenByBoth) {
  for (const double z_mm : {30.0, 60.0, 90.0, 140.0, 170.0}) {
    for (const Vec3& toward : {Vec3(0, 0, 1), Vec3(0, 0, -1), Vec3(-0.84, 0.54, 0), Vec3(-0.4, -0.6, 0.7)})
      EXPECT_EQ(Alone(Dragged(model_, 3 * toward, z_mm)), std::nullopt)
          << toward.transpose() << " at " << z_mm;
  }
}

// Also where one camera saw but half of the markers: of the others nothing is known.
TEST_F(RestComparisonTest, ATareIsTheNewBaseline) {
  LabelledMarkers now = See(Dented(3, 90, 2), Inflated(2));
  for (size_t m = 0; m < now.cameras[0].size(); m += 2) now.cameras[0][m].seen = false;
  rest_.SetBaseline(now);
  EXPECT_EQ(Alone(Dented(3, 90, 2), Inflated(2)), std::nullopt);
  EXPECT_EQ(Alone(Dented(3, 90, 3), Inflated(3), 1), std::nullopt);
  EXPECT_EQ(Alone(Inflated(2)), CameraId::kTop);
}

}  // namespace
}  // namespace taclink
