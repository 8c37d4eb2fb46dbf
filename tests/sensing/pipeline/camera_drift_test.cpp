#include "sensing/pipeline/camera_drift.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>
#include <string>

#include "sensing/camera/camera_fit.h"
#include "sensing/camera/projection.h"
#include "sensing/camera/rest_shape.h"
#include "sensing/model/model_file.h"
#include "tests/support/studio.h"

namespace taclink {
namespace {

constexpr double kNoisePx = 0.05;

class CameraDriftTest : public ::testing::TestWithParam<std::string> {
 protected:
  // What `rig` sees of markers; the images are scaled about their principal points afterwards.
  LabelledMarkers See(const std::vector<Vec3>& markers_mm, const StereoRig& rig,
                      const std::array<double, kCameraCount>& scales = {1, 1}) {
    std::normal_distribution<double> noise(0, kNoisePx);
    Eigen::VectorXd displaced_mm(3 * model_.markers.count());
    for (int m = 0; m < model_.markers.count(); ++m)
      displaced_mm.segment<3>(3 * m) = markers_mm[static_cast<size_t>(m)] - model_.RestMarker(m);
    const RestShape shape(model_, displaced_mm);
    LabelledMarkers labels;
    for (const CameraId id : kBothCameras) {
      const Projector projector(rig[id]);
      const Vec2 middle = rig[id].lens.principal_point_px;
      for (int m = 0; m < model_.markers.count(); ++m) {
        const auto pixel = projector.Project(SeenPoint(shape, m, projector.center_in_link(), true));
        MarkerObservation& one = labels.cameras[Index(id)].emplace_back();
        if (!pixel) continue;
        one = {true, middle + scales[Index(id)] * (*pixel - middle) + Vec2(noise(random_), noise(random_)),
               kNoisePx * kNoisePx * Mat2::Identity()};
      }
    }
    return labels;
  }
  // A nonlinear skin that a disc presses at mid-length.
  std::vector<Vec3> Pressed(double kpa, double force_n) const {
    char text[400];
    std::snprintf(text, sizeof text,
                  "taclink_scene: 1\nname: pressed\nmodel: %s\nframe_rate_hz: 10\nduration_s: 2\n"
                  "pressure_kpa: %g\ncontacts:\n"
                  "  - {at: {path: 7, ring: 5}, force_n: %g, begin_s: 0, end_s: 2, ramp_s: 0.01}\n",
                  model_.name.c_str(), kpa, force_n);
    SkinTruth truth;
    SimulatedSkin::Make(model_, ParseScene("pressed", text).value()).value()->Evaluate(1, truth);
    return truth.marker_mm;
  }
  std::vector<Vec3> UntouchedAt(double kpa) {
    std::vector<Vec3> markers_mm = model_.RestMarkers();
    const UntouchedSkin* skin = mechanics_.Untouched({.pressure_mpa = 1e-3 * kpa});
    for (size_t m = 0; m < markers_mm.size(); ++m)
      markers_mm[m] += skin->markers_mm.segment<3>(3 * static_cast<Eigen::Index>(m));
    return markers_mm;
  }
  CameraDrift Begin(double kpa) {
    const MeasuredLoads loads{.pressure_mpa = 1e-3 * kpa, .pressure_sigma_mpa = 5e-5};
    rest_ = See(UntouchedAt(kpa), rig_);
    return {mechanics_, loads, rig_, rest_};
  }
  // Against an estimate that nothing moves.
  ImageResiduals FromRest(const LabelledMarkers& now) const {
    ImageResiduals residuals;
    for (size_t c = 0; c < kCameraCount; ++c) {
      residuals[c].resize(now.cameras[c].size());
      for (size_t m = 0; m < now.cameras[c].size(); ++m) {
        if (now.cameras[c][m].seen && rest_.cameras[c][m].seen)
          residuals[c][m] = {.px = now.cameras[c][m].center_px - rest_.cameras[c][m].center_px};
      }
    }
    return residuals;
  }

  const LinkModel model_ = LoadLinkModel(GetParam()).value();
  const StereoRig rig_ = model_.nominal_rig;
  SkinMechanics mechanics_{model_};
  LabelledMarkers rest_;
  std::mt19937 random_{1};
};

TEST_P(CameraDriftTest, GrowthOfEachImageIsMeasured) {
  for (const double kpa : {0.0, 0.5}) {
    CameraDrift drift = Begin(kpa);
    const auto none = drift.Measure(FromRest(See(UntouchedAt(kpa), rig_)));
    ASSERT_TRUE(none);
    for (const auto& growth : *none) EXPECT_NEAR(growth.share, 0, 5e-4);
    // Inflated by 30 Pa more than is measured.
    const auto found = drift.Measure(FromRest(See(UntouchedAt(kpa + 0.03), rig_, {1.008, 0.996})));
    ASSERT_TRUE(found);
    EXPECT_NEAR((*found)[0].share, 0.008, 1e-3);
    EXPECT_NEAR((*found)[1].share, -0.004, 1e-3);
    EXPECT_LT((*found)[0].sigma, 1e-3);
  }
}

TEST_P(CameraDriftTest, IsMeasuredBesideATouch) {
  CameraDrift drift = Begin(0.5);
  const auto found = drift.Measure(FromRest(See(Pressed(0.5, 0.2), rig_, {1.01, 1})));
  ASSERT_TRUE(found);
  EXPECT_NEAR((*found)[0].share, 0.01, 1.5e-3);
  EXPECT_NEAR((*found)[1].share, 0, 1.5e-3);
}

TEST_P(CameraDriftTest, ATouchIsNoGrowth) {
  int measured = 0;
  for (const double kpa : {0.0, 0.5}) {
    CameraDrift drift = Begin(kpa);
    for (const double force_n : {0.05, 0.08}) {
      const auto found = drift.Measure(FromRest(See(Pressed(kpa, force_n), rig_)));
      if (!found) continue;  // first order does not hold
      ++measured;
      for (const auto& growth : *found) EXPECT_LT(std::abs(growth.share), 0.003) << kpa << " " << force_n;
    }
  }
  EXPECT_GT(measured, 0);
}

TEST_P(CameraDriftTest, ATurnOrASidewaysMoveIsNoGrowth) {
  CameraDrift drift = Begin(0.5);
  StereoRig moved = rig_;
  Misalign(moved[CameraId::kTop], {0.1, 0, 0.1}, {0.1, 0, 0});
  const auto found = drift.Measure(FromRest(See(UntouchedAt(0.5), moved)));
  ASSERT_TRUE(found);
  for (const auto& growth : *found) EXPECT_NEAR(growth.share, 0, 1.5e-3);
}

TEST_P(CameraDriftTest, WithFewMarkersNothingIsMeasured) {
  CameraDrift drift = Begin(0.5);
  LabelledMarkers labels = See(UntouchedAt(0.5), rig_);
  for (auto& one : labels.cameras[0]) one.seen = false;
  EXPECT_FALSE(drift.Measure(FromRest(labels)));
}

INSTANTIATE_TEST_SUITE_P(ShippedModels, CameraDriftTest, ::testing::Values("cylinder", "barrel"));

}  // namespace
}  // namespace taclink
