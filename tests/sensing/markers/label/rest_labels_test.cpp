#include "sensing/markers/label/rest_labels.h"

#include <gtest/gtest.h>

#include "sensing/markers/detect/detector.h"
#include "sensing/markers/label/picture_labels.h"
#include "sensing/model/model_file.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/simulated_skin.h"
#include "tests/support/drawn_vector.h"
#include "tests/support/paths.h"
#include "tests/support/read_jpeg.h"
#include "tests/support/rest_pair.h"
#include "tests/support/synthetic_markers.h"

namespace taclink {
namespace {

/// The rig as it might have been built: principal points off by tens of px, rolled, other lenses.
StereoRig Built(const LinkModel& model, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  StereoRig rig = model.nominal_rig;
  for (const CameraId id : kBothCameras) {
    rig[id].lens.principal_point_px += 30 * DrawnVec2([&] { return uniform(random); });
    rig[id].lens.focal_px *= 1 + 0.05 * uniform(random);
    const Mat3 roll(
        Eigen::AngleAxisd(0.35 * model.markers.path_pitch_rad() * uniform(random), Vec3::UnitZ()));
    rig[id].camera_from_link.rotation = roll * rig[id].camera_from_link.rotation;
    rig[id].camera_from_link.translation = roll * rig[id].camera_from_link.translation;
  }
  return rig;
}

SkinTruth RestTruth(const LinkModel& model) {
  SkinTruth truth;
  SimulatedSkin::Make(model, LoadScene("rest").value()).value()->Evaluate(0, truth);
  return truth;
}

class RestLabelsTest : public ::testing::TestWithParam<std::string> {
 protected:
  LinkModel model_ = LoadLinkModel(GetParam()).value();
};

TEST_P(RestLabelsTest, FindsTheGridWithoutCalibration) {
  std::mt19937 random(5);
  for (int trial = 0; trial < 15; ++trial) {
    const auto view =
        See(model_, Built(model_, random), {}, {.noise_px = 0.2, .drop = 0.03, .false_spots = 4}, random);
    const auto labels = LabelRestPair(model_, view.detections);
    ASSERT_TRUE(labels.ok()) << labels.error().message;
    const LabelScore score = Score(view, *labels);
    EXPECT_LE(score.wrong, 2) << "trial " << trial;  // a false spot beside its marker
    EXPECT_GE(score.right, 0.97 * score.shown);
  }
}

TEST_P(RestLabelsTest, NoiseIsRefused) {
  std::mt19937 random(5);
  const auto view = See(model_, model_.nominal_rig, {}, {.drop = 1, .false_spots = 250}, random);
  const auto labels = LabelRestPair(model_, view.detections);
  ASSERT_FALSE(labels.ok());
  EXPECT_EQ(labels.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(labels.error().message.find("top camera"), std::string::npos);
}

// 2 mm and 2 degrees off, seen by the renderer and found by the detector.
TEST_P(RestLabelsTest, MisalignedCameras) {
  std::mt19937 random(8);
  std::uniform_real_distribution<double> uniform(-1, 1);
  MarkerDetector detector;
  for (int trial = 0; trial < 6; ++trial) {
    StereoRig rig = model_.nominal_rig;
    for (const CameraId id : kBothCameras) {
      const Vec3 axis = DrawnVec3([&] { return uniform(random); }).normalized();
      const Vec3 shift = 2 * DrawnVec3([&] { return uniform(random); }).normalized();
      Rigid3& pose = rig[id].camera_from_link;
      const Mat3 turn(Eigen::AngleAxisd(RadFromDeg(2), axis));
      pose.rotation = turn * pose.rotation;
      pose.translation = turn * pose.translation + shift;
    }
    Renderer renderer(model_, rig, {}, 5);
    const SkinTruth truth = RestTruth(model_);
    for (const CameraId id : kBothCameras) {
      cv::Mat gray;
      Detections found;
      renderer.Render(truth, id, gray);
      detector.Detect(gray, found);
      const auto labels = LabelPicture(model_, id, found, gray);
      ASSERT_TRUE(labels.ok()) << trial << ": " << labels.error().message;
      EXPECT_GE(labels->markers.size(), 0.9 * model_.markers.count());
      const Projector projector(rig[id]);
      for (const PictureMarker& m : labels->markers) {
        if (m.detection.clipped) continue;
        const Vec2 off = m.detection.center_px - projector.Project(model_.RestMarker(m.marker)).value();
        EXPECT_LT(off.norm(), std::max(1.5, 0.3 * m.detection.width_px)) << m.marker;
      }
    }
  }
}

TEST_P(RestLabelsTest, WrongModelsAreRefused) {
  std::mt19937 random(5);
  const auto view = See(model_, Built(model_, random), {}, {.noise_px = 0.2, .drop = 0.02}, random);
  const auto refused = [&](const LinkModel& model, const std::string& why) {
    const auto labels = LabelRestPair(model, view.detections);
    ASSERT_FALSE(labels.ok()) << why;
    EXPECT_NE(labels.error().message.find(why), std::string::npos) << labels.error().message;
  };
  LinkModel wrong = model_;
  wrong.markers.rings_z_mm.pop_back();
  refused(wrong, "ring");
  wrong = model_;
  wrong.markers.rings_z_mm.push_back(2 * model_.markers.rings_z_mm.back() -
                                     model_.markers.rings_z_mm[model_.markers.rings_z_mm.size() - 2]);
  wrong.length_mm += 20;
  refused(wrong, "ring");
  wrong = model_;
  wrong.markers.paths -= 1;
  refused(wrong, std::to_string(model_.markers.paths) + " paths");
  wrong = model_;
  wrong.markers.paths *= 2;
  refused(wrong, "spots found");
}

INSTANTIATE_TEST_SUITE_P(ShippedModels, RestLabelsTest, ::testing::Values("cylinder", "barrel"));

// From the narrow end of a cone its far rings are 3 px apart and run into one another: they cost nothing but
// their own markers.
TEST(RestLabels, ConeWhoseFarRingsRunTogether) {
  const LinkModel model = LoadLinkModel("cone").value();
  Renderer renderer(model, model.nominal_rig, {}, 5);
  const SkinTruth truth = RestTruth(model);
  MarkerDetector detector;
  for (const CameraId id : kBothCameras) {
    cv::Mat gray;
    Detections found;
    renderer.Render(truth, id, gray);
    detector.Detect(gray, found);
    const auto labels = LabelPicture(model, id, found, gray);
    ASSERT_TRUE(labels.ok()) << labels.error().message;
    EXPECT_GE(labels->markers.size(), id == CameraId::kTop ? 235u : 180u);
    const Projector projector(model.nominal_rig[id]);
    for (const PictureMarker& m : labels->markers)
      EXPECT_LT((m.detection.center_px - projector.Project(model.RestMarker(m.marker)).value()).norm(), 1.5)
          << m.marker;
  }
}

TEST(RestLabels, RealPicture) {
  const LinkModel model = LoadLinkModel("barrel").value();
  MarkerDetector detector;
  Detections found;
  detector.Detect(ReadJpegGray(testing::TestData("barrel_real_bottom.jpg")), found);
  const auto seen = LabelRestPicture(model, CameraId::kBottom, found);
  ASSERT_TRUE(seen.ok()) << seen.error().message;
  EXPECT_GE(std::count_if(seen->begin(), seen->end(), [](const auto& o) { return o.seen; }), 225);
}

}  // namespace
}  // namespace taclink
