#include <gtest/gtest.h>

#include "bench/thesis/thesis_camera.h"
#include "bench/thesis/thesis_method.h"
#include "bench/vision/vision_score.h"
#include "sensing/model/model_file.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink {
namespace {

class ThesisTest : public ::testing::TestWithParam<std::string> {
 protected:
  const LinkModel model_ = LoadLinkModel(GetParam()).value();
};

// (4.3) to (4.15) and (4.41) against the cameras' own projection.
TEST_P(ThesisTest, NominalCameraSeesWhatTheProjectorSees) {
  for (const CameraId id : kBothCameras) {
    const Projector projector(model_.nominal_rig[id]);
    const ThesisCamera camera = NominalThesisCamera(model_, id);
    for (const Vec3& p : model_.RestMarkers()) {
      const auto pixel = projector.Project(p);
      const auto there = camera.Project(p);
      ASSERT_TRUE(pixel && there);
      EXPECT_LT((*pixel - *there).norm(), 0.1);
      const auto [r, phi] = camera.See(*pixel);
      EXPECT_NEAR(r * camera.Depth(p.z()) / camera.focal_px, p.head<2>().norm(), 1e-6);
      EXPECT_NEAR(std::remainder(phi - std::atan2(p.y(), p.x()), 2 * kPi), 0, 1e-9);
    }
  }
}

// (4.35) to (4.43) on exact projections of a camera that is off the nominal one but coaxial.
TEST_P(ThesisTest, SelfCalibrationFindsACoaxialCamera) {
  for (const CameraId id : kBothCameras) {
    CameraModel real = model_.nominal_rig[id];
    real.lens.focal_px *= 1.02;
    real.lens.principal_point_px += Vec2(6, -4);
    const Mat3 roll(Eigen::AngleAxisd(RadFromDeg(1.5), Vec3::UnitZ()));
    real.camera_from_link = Rigid3{roll, Vec3::Zero()} * real.camera_from_link;
    const Projector projector(real);
    std::vector<MarkerObservation> rest;
    for (const Vec3& p : model_.RestMarkers()) {
      rest.emplace_back();
      rest.back().seen = true;
      rest.back().center_px = *projector.Project(p);
    }
    const auto camera = CalibrateThesisCamera(model_, id, rest);
    ASSERT_TRUE(camera);
    EXPECT_LT((camera->principal_px - real.lens.principal_point_px).norm(), 1e-6);
    double squares = 0;
    for (size_t m = 0; m < rest.size(); ++m) {
      const Vec3 p = model_.RestMarker(static_cast<int>(m));
      const auto [r, phi] = camera->See(rest[m].center_px);
      EXPECT_NEAR(std::remainder(phi - std::atan2(p.y(), p.x()), 2 * kPi), 0, 1e-6);
      squares += std::pow(r * camera->Depth(p.z()) / camera->focal_px - p.head<2>().norm(), 2);
    }
    EXPECT_LT(std::sqrt(squares / static_cast<double>(rest.size())), 0.1);
  }
}

// On clean pictures of a skin that is blown up. (A dent that hides a marker or merges two makes the labels
// behind it slip along the path, by the method itself.)
TEST_P(ThesisTest, WorksOnIdealPictures) {
  Scene scene;
  scene.skin = SkinKind::kLinear;
  scene.duration_s = 4;
  scene.loop = false;
  scene.camera = {.sensor_noise_levels = 0, .mount = {}};
  scene.pressure = {{0.9, 0}, {1.5, 0.5}};
  auto skin = SimulatedSkin::Make(model_, scene);
  ASSERT_TRUE(skin.ok()) << skin.error().message;
  Renderer renderer(model_, model_.nominal_rig, scene.camera, 1);
  const auto method = MakeThesisMethod(model_);
  VisionScorer scorer(model_);
  StereoFrame frame;
  SkinTruth skin_truth;
  VisionTruth truth;
  VisionResult result;
  cv::Mat gray;
  for (int k = 0; k < 24; ++k) {
    (*skin)->Evaluate(0.1 * k, skin_truth);
    for (const CameraId id : kBothCameras) {
      renderer.Render(skin_truth, id, gray);
      PackYuyv(gray, {}, frame.images[Index(id)]);
    }
    method->Process(frame, result);
    MakeVisionTruth(model_, model_.nominal_rig, renderer, skin_truth, truth);
    if (k >= 8) scorer.Add(truth, result);
  }
  const VisionScore& score = scorer.score();
  EXPECT_EQ(score.measured, 16);
  for (const LabelCounts& labels : score.labels) {
    EXPECT_LT(static_cast<double>(labels.wrong + labels.stray), 2e-3 * static_cast<double>(labels.visible));
    EXPECT_LT(static_cast<double>(labels.missing), 0.01 * static_cast<double>(labels.visible));
  }
  EXPECT_LT(score.position[2].Rms(ErrorAxis::k3d), 0.4);
  std::printf("%s: RMSE %.3f mm, worst %.2f mm\n", GetParam().c_str(), score.position[2].Rms(ErrorAxis::k3d),
              score.position[2].Worst(ErrorAxis::k3d));
}

INSTANTIATE_TEST_SUITE_P(ShippedModels, ThesisTest, ::testing::Values("cylinder", "barrel"));

}  // namespace
}  // namespace taclink
