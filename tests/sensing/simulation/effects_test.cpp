#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "sensing/simulation/dirt.h"
#include "sensing/simulation/renderer.h"
#include "tests/sensing/simulation/scene_text.h"

namespace taclink {
namespace {

cv::Mat Picture(const LinkModel& model, const CameraEffects& effects, const SkinTruth& truth) {
  Renderer renderer(model, MountedRig(model.nominal_rig, effects), effects, 3);
  cv::Mat gray;
  renderer.Render(truth, CameraId::kTop, gray);
  return gray;
}

TEST(CameraEffects, ReadFromASceneFile) {
  const Scene scene = SceneWith(
      "camera: {flicker: 0.1, dirt_specks: 12, mount: {bottom: {shift_mm: [1, 2, 3], turn_deg: [0, 0, "
      "9]}}}\n");
  EXPECT_EQ(scene.camera.flicker, 0.1);
  EXPECT_EQ(scene.camera.dirt_specks, 12);
  EXPECT_FALSE(scene.camera.mount[0].any());
  EXPECT_EQ(scene.camera.mount[1].shift_mm, Vec3(1, 2, 3));
  EXPECT_NEAR(scene.camera.mount[1].turn_rad.z(), RadFromDeg(9), 1e-12);
  for (const char* bad : {"camera: {mount: {left: {}}}\n", "camera: {mount: {top: {shift_mm: [1, 2]}}}\n",
                          "camera: {flicker: -1}\n", "camera: {dirt_specks: 1.5}\n"})
    EXPECT_FALSE(ParseScene("s.yaml", std::string("taclink_scene: 1\nname: s\nduration_s: 4\n") + bad).ok())
        << bad;
}

TEST(CameraEffects, AMountErrorMovesTheCameraInItsOwnFrame) {
  const LinkModel model = Model("cylinder");
  CameraEffects effects;
  effects.mount[1] = {.shift_mm = {1, 0, 2}, .turn_rad = {0, RadFromDeg(3), 0}};
  const StereoRig rig = MountedRig(model.nominal_rig, effects);
  const Rigid3& nominal = model.nominal_rig[CameraId::kBottom].camera_from_link;
  const Rigid3& real = rig[CameraId::kBottom].camera_from_link;
  // Where the real camera's origin is, as the nominal one would see it.
  EXPECT_NEAR((nominal * real.Inverse().translation - Vec3(1, 0, 2)).norm(), 0, 1e-9);
  EXPECT_NEAR(Eigen::AngleAxisd(Mat3(real.rotation * nominal.rotation.transpose())).angle(), RadFromDeg(3),
              1e-9);
  EXPECT_EQ(rig[CameraId::kTop].camera_from_link.translation,
            model.nominal_rig[CameraId::kTop].camera_from_link.translation);
}

TEST(CameraEffects, FlickerScalesWholePicturesAndChangesFromFrameToFrame) {
  const LinkModel model = Model("cylinder");
  CameraEffects effects;
  effects.sensor_noise_levels = 0;
  SkinTruth truth = TruthAt(model, SceneWith(""), 0);
  const double steady = cv::mean(Picture(model, effects, truth))[0];
  effects.flicker = 0.2;
  Renderer renderer(model, model.nominal_rig, effects, 3);
  double sum = 0, squares = 0;
  constexpr int kFrames = 400;
  for (int i = 0; i < kFrames; ++i) {
    truth.frame = static_cast<uint64_t>(i);
    const double gain = renderer.Gain(truth, CameraId::kTop);
    sum += gain;
    squares += gain * gain;
    if (i > 3) continue;
    EXPECT_NEAR(cv::mean(Picture(model, effects, truth))[0] / steady, gain, 0.03);
    EXPECT_NE(gain, renderer.Gain(truth, CameraId::kBottom));
  }
  EXPECT_NEAR(sum / kFrames, 1, 0.03);
  EXPECT_NEAR(std::sqrt(squares / kFrames - std::pow(sum / kFrames, 2)), 0.2, 0.03);
}

TEST(CameraEffects, DirtDarkensAndBrightensTheSamePlacesOfEveryPicture) {
  const Dirt dirt(640, 480, 40, 7);
  cv::Mat first(480, 640, CV_8U, cv::Scalar(120)), second(480, 640, CV_8U, cv::Scalar(120));
  dirt.CoverLens(first);
  dirt.CoverLens(second);
  EXPECT_EQ(cv::countNonZero(first != second), 0);
  const int darker = cv::countNonZero(first < 110), brighter = cv::countNonZero(first > 130);
  EXPECT_GT(darker, 200);
  EXPECT_GT(brighter, 50);
  EXPECT_LT(darker + brighter, 640 * 480 / 20);
  cv::Mat clean(480, 640, CV_8U, cv::Scalar(120));
  Dirt().CoverLens(clean);
  EXPECT_EQ(cv::countNonZero(clean != 120), 0);
}

// What the truth says of a marker in the picture is what the picture shows.
TEST(CameraEffects, CentroidIsThatOfTheDrawnMarker) {
  for (const char* name : {"cylinder", "barrel"}) {
    const LinkModel model = Model(name);
    CameraEffects effects;
    effects.sensor_noise_levels = 0;
    effects.marker_jitter_px = 2;
    const SkinTruth all = TruthAt(model, SceneWith(""), 0);
    Renderer renderer(model, model.nominal_rig, effects, 3);
    for (int marker = 5; marker < model.markers.count(); marker += 23) {
      SkinTruth without = all, alone = all;
      for (size_t i = 0; i < all.marker_wall_mm.size(); ++i) {
        without.marker_wall_mm[i] = Vec3(0, 1e6, 0);
        if (static_cast<int>(i) != marker) alone.marker_wall_mm[i] = Vec3(0, 1e6, 0);
      }
      for (const CameraId id : kBothCameras) {
        cv::Mat with_it, empty, drawn;
        renderer.Render(alone, id, with_it);
        renderer.Render(without, id, empty);
        cv::subtract(with_it, empty, drawn);
        const cv::Moments m = cv::moments(drawn);
        const auto said = renderer.Centroid(all, id, marker);
        ASSERT_TRUE(said);
        if (m.m00 <= 0 || said->x() < 25 || said->y() < 25 || said->x() > 615 || said->y() > 455) continue;
        // Brightness falls off away from the light, so weighting by it shifts large markers a little.
        EXPECT_LT((Vec2(m.m10 / m.m00, m.m01 / m.m00) - *said).norm(), 0.8) << name << " " << marker;
      }
    }
  }
}

}  // namespace
}  // namespace taclink
