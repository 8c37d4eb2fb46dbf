#include "sensing/markers/rest_labels.h"

#include <gtest/gtest.h>

#include "sensing/markers/detector.h"
#include "sensing/model/model_file.h"
#include "tests/support/read_jpeg.h"
#include "tests/support/synthetic_markers.h"

namespace taclink {
namespace {

/// The rig as it might have been built: principal points off by tens of px, rolled, other lenses.
StereoRig Built(const LinkModel& model, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  StereoRig rig = model.nominal_rig;
  for (const CameraId id : kBothCameras) {
    rig[id].lens.principal_point_px += 30 * Vec2(uniform(random), uniform(random));
    rig[id].lens.focal_px *= 1 + 0.05 * uniform(random);
    const Mat3 roll(
        Eigen::AngleAxisd(0.35 * model.markers.path_pitch_rad() * uniform(random), Vec3::UnitZ()));
    rig[id].camera_from_link.rotation = roll * rig[id].camera_from_link.rotation;
    rig[id].camera_from_link.translation = roll * rig[id].camera_from_link.translation;
  }
  return rig;
}

class RestLabelsTest : public testing::TestWithParam<std::string> {
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

INSTANTIATE_TEST_SUITE_P(ShippedModels, RestLabelsTest, testing::Values("cylinder", "barrel"));

TEST(RestLabels, RealPicture) {
  const LinkModel model = LoadLinkModel("barrel").value();
  MarkerDetector detector;
  Detections found;
  detector.Detect(ReadJpegGray(std::string(TACLINK_TEST_DATA) + "/barrel_real_bottom.jpg"), found);
  const auto seen = LabelRestPicture(model, CameraId::kBottom, found);
  ASSERT_TRUE(seen.ok()) << seen.error().message;
  EXPECT_GE(std::count_if(seen->begin(), seen->end(), [](const auto& o) { return o.seen; }), 225);
}

}  // namespace
}  // namespace taclink
