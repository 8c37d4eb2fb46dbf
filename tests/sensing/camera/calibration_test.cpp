#include "sensing/camera/calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sensing/markers/detect/detector.h"
#include "sensing/markers/label/rest_labels.h"
#include "sensing/model/model_file.h"
#include "tests/support/paths.h"
#include "tests/support/read_jpeg.h"
#include "tests/support/rest_pair.h"
#include "tests/support/synthetic_markers.h"

namespace taclink {
namespace {

/// The cylinder of table 4.1, and a model file that only roughly knows its cameras.
struct Cameras {
  LinkModel truth = LoadLinkModel("cylinder").value();
  LinkModel nominal = truth;

  Cameras() {
    for (const CameraId id : kBothCameras) {
      CameraModel& camera = nominal.nominal_rig[id];
      camera.lens.principal_point_px += id == CameraId::kTop ? Vec2(20, -16) : Vec2(-18, 20);
      camera.lens.focal_px *= 0.96;
      camera.lens.k1_per_px2 = camera.lens.k2_per_px4 = 0;
      const Vec3 shift(0, 0, id == CameraId::kTop ? 2 : -1.5);
      camera.camera_from_link.translation -= camera.camera_from_link.rotation * shift;
    }
  }
};

/// The made-up pictures of these tests show points.
const CalibrationOptions kPoints{.domes = false};

TEST(Calibration, FindsTheCamerasOfTable41) {
  Cameras setup;
  std::mt19937 random(8);
  for (int trial = 0; trial < 3; ++trial) {
    const auto view = See(setup.truth, setup.truth.nominal_rig, {}, {.noise_px = 0.1, .drop = 0.02}, random);
    const auto labels = LabelRestPair(setup.nominal, view.detections);
    ASSERT_TRUE(labels.ok()) << labels.error().message;
    const auto found = CalibrateFromRest(setup.nominal, *labels, kPoints);
    ASSERT_TRUE(found.ok()) << found.error().message;
    EXPECT_NEAR(found->rms_px, 0.1, 0.02);
    EXPECT_LT(found->rmse_3d_mm, 0.2);
    EXPECT_GT(found->markers_used, 200);
    for (const CameraId id : kBothCameras) {
      const CameraModel &camera = found->rig[id], &truth = setup.truth.nominal_rig[id];
      EXPECT_NEAR(camera.lens.focal_px, truth.lens.focal_px, 1.0);
      EXPECT_NEAR(camera.camera_from_link.Inverse().translation.z(),
                  truth.camera_from_link.Inverse().translation.z(), 1.0);
      // A tilt and the principal point are hard to tell apart.
      EXPECT_LT((camera.lens.principal_point_px - truth.lens.principal_point_px).norm(), 0.6);
      const CameraStep off = StepBetween(truth, camera);
      for (int i = 0; i < 11; ++i) EXPECT_LT(std::abs(off[i]), 4 * found->cameras[Index(id)].sigmas[i]) << i;
      // What counts in the end: where markers appear.
      const Projector a(camera), b(truth);
      for (const Vec3& p : setup.truth.RestMarkers()) EXPECT_LT((*a.Project(p) - *b.Project(p)).norm(), 0.12);
    }
  }
}

TEST(Calibration, RollIsFound) {
  Cameras setup;
  std::mt19937 random(9);
  StereoRig built = setup.truth.nominal_rig;
  const Mat3 roll(Eigen::AngleAxisd(RadFromDeg(4), Vec3::UnitZ()));
  CameraModel& camera = built[CameraId::kBottom];
  camera.camera_from_link.rotation = roll * camera.camera_from_link.rotation;
  camera.camera_from_link.translation = roll * camera.camera_from_link.translation;
  const auto view = See(setup.truth, built, {}, {.noise_px = 0.1}, random);
  const auto found =
      CalibrateFromRest(setup.nominal, LabelRestPair(setup.nominal, view.detections).value(), kPoints);
  ASSERT_TRUE(found.ok()) << found.error().message;
  const Mat3 off =
      found->rig[CameraId::kBottom].camera_from_link.rotation * camera.camera_from_link.rotation.transpose();
  EXPECT_LT(DegFromRad(Eigen::AngleAxisd(off).angle()), 0.1);
}

TEST(Calibration, WrongLabelsAreLeftOutOrRefused) {
  Cameras setup;
  std::mt19937 random(10);
  const auto view = See(setup.truth, setup.truth.nominal_rig, {}, {.noise_px = 0.1}, random);
  LabelledMarkers labels = LabelRestPair(setup.nominal, view.detections).value();
  for (size_t i = 0; i < 8; ++i) labels.cameras[0][20 * i].center_px += Vec2(6, -5);
  const auto few = CalibrateCamera(setup.nominal, CameraId::kTop, labels.cameras[0], kPoints);
  ASSERT_TRUE(few.ok()) << few.error().message;
  EXPECT_EQ(few->outliers, 8);
  EXPECT_NEAR(few->rms_px, 0.1, 0.03);
  for (auto& observation : labels.cameras[0]) observation.center_px += 8 * Vec2::Random();
  const auto many = CalibrateFromRest(setup.nominal, labels, kPoints);
  ASSERT_FALSE(many.ok());
  EXPECT_EQ(many.error().code, ErrorCode::kInvalidArgument);
  for (auto& observation : labels.cameras[1]) observation.seen = false;
  const auto none = CalibrateCamera(setup.nominal, CameraId::kBottom, labels.cameras[1]);
  ASSERT_FALSE(none.ok());
  EXPECT_NE(none.error().message.find("bottom camera sees only 0"), std::string::npos);
}

TEST(Calibration, TouchedSkinIsRefusedAndSaidWhere) {
  const Cameras setup;
  std::mt19937 random(11);
  struct Touch {
    double depth_mm, width_mm;
  };
  for (const auto& [depth_mm, width_mm] : {Touch{1.5, 20}, Touch{4, 20}, Touch{-2, 20}, Touch{4, 9}}) {
    const Dent dent{setup.truth.PathAngle(6), 90, depth_mm, width_mm};
    const auto view = See(setup.truth, setup.truth.nominal_rig, {dent}, {.noise_px = 0.1}, random);
    const auto found =
        CalibrateFromRest(setup.truth, LabelRestPair(setup.truth, view.detections).value(), kPoints);
    ASSERT_FALSE(found.ok()) << depth_mm;
    EXPECT_THAT(found.error().message, ::testing::ContainsRegex("near path [678], ring [456]"));
    EXPECT_THAT(found.error().message, ::testing::HasSubstr(depth_mm > 0 ? "inside" : "outside"));
  }
}

TEST(Calibration, CameraFarOffTheModelIsRefused) {
  Cameras setup;
  std::mt19937 random(12);
  const auto view = See(setup.truth, setup.truth.nominal_rig, {}, {.noise_px = 0.1}, random);
  const auto labels = LabelRestPair(setup.truth, view.detections).value();
  setup.nominal = setup.truth;
  setup.nominal.nominal_rig[CameraId::kBottom].lens.focal_px *= 1.25;
  const auto found = CalibrateFromRest(setup.nominal, labels, kPoints);
  ASSERT_FALSE(found.ok());
  EXPECT_NE(found.error().message.find("bottom camera magnifies by"), std::string::npos)
      << found.error().message;
}

// One picture of a real link, whose markers are up to 1 mm off the published shape: more than any noise.
TEST(Calibration, RealPicture) {
  const LinkModel model = LoadLinkModel("barrel").value();
  MarkerDetector detector;
  Detections found;
  detector.Detect(ReadJpegGray(testing::TestData("barrel_real_bottom.jpg")), found);
  const auto labels = LabelRestPicture(model, CameraId::kBottom, found);
  ASSERT_TRUE(labels.ok()) << labels.error().message;
  for (const LensKind lens : {LensKind::kDivision, LensKind::kKannalaBrandt}) {
    const auto camera = CalibrateCamera(model, CameraId::kBottom, *labels, {.lens = lens});
    ASSERT_TRUE(camera.ok()) << camera.error().message;
    EXPECT_EQ(camera->camera.lens.kind, lens);
    EXPECT_LT(camera->rms_px, 1.35);
    EXPECT_GT(camera->markers_used, 210);
    EXPECT_LE(camera->outliers, 5);
  }
}

}  // namespace
}  // namespace taclink
