#include "sensing/pipeline/picture_calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "sensing/camera/triangulation.h"
#include "sensing/model/model_file.h"
#include "sensing/pipeline/state_estimator.h"
#include "tests/support/studio.h"

namespace taclink {
namespace {

using ::testing::HasSubstr;

std::string Message(const Result<CalibrationSummary>& result) {
  return result.ok() ? "accepted" : result.error().message;
}

Result<CalibrationSummary> Calibrate(const LinkModel& model, const PicturePair& pair,
                                     const CalibrationOptions& options = {}) {
  return CalibrateFromPictures(model, {&pair, 1}, options);
}

/// Root mean square error of points that both cameras of `truth` see, triangulated with `found`.
double TriangulationRmse(const StereoRig& truth, const StereoRig& found, const std::vector<Vec3>& points) {
  std::array<SightRay, kCameraCount> rays;
  double squares = 0;
  for (const Vec3& p : points) {
    for (const CameraId id : kBothCameras) {
      const Projector sees(truth[id]), believes(found[id]);
      rays[Index(id)] = {believes.center_in_link(), *believes.Ray(*sees.Project(p))};
    }
    squares += (MeetRays(rays[0], rays[1])->point_mm - p).squaredNorm();
  }
  return std::sqrt(squares / static_cast<double>(points.size()));
}

struct Misaligned {
  std::string model;
  Vec3 turn_deg, move_mm;  ///< of the top camera; the bottom one's are others, as large
};

class MisalignedTest : public ::testing::TestWithParam<Misaligned> {};

TEST_P(MisalignedTest, PairIsRecoveredFromItsPictures) {
  const auto& [name, turn_deg, move_mm] = GetParam();
  const LinkModel model = LoadLinkModel(name).value();
  const Studio studio(model);
  StereoRig rig = model.nominal_rig;
  Misalign(rig[CameraId::kTop], turn_deg, move_mm);
  Misalign(rig[CameraId::kBottom], {-turn_deg.y(), turn_deg.z(), turn_deg.x()},
           {move_mm.z(), -move_mm.x(), move_mm.y()});
  const auto found = Calibrate(model, studio.Take(rig, studio.Truth()));
  ASSERT_TRUE(found.ok()) << found.error().message;
  for (const CameraId id : kBothCameras) {
    const CameraCalibration& one = found->cameras[Index(id)];
    EXPECT_LT(one.rms_px, 0.1);
    const CameraStep off = StepBetween(rig[id], one.camera);
    for (int i = 0; i < CameraParameterCount(LensKind::kDivision); ++i) {
      EXPECT_LT(std::abs(off[i]), 3 * one.sigmas[i]) << Name(id) << ", parameter " << i;
    }
    EXPECT_LT(DegFromRad(off.head<3>().norm()), 0.25);
    EXPECT_LT(off.segment<2>(3).norm(), 0.1);
    EXPECT_LT(std::abs(off[5]), 1.5);  // along the axis: a picture hardly tells it from the focal length
  }
  EXPECT_LT(found->rmse_3d_mm, 0.15);
  // The skin pressed in, as the fitted cameras never saw it.
  const SkinTruth pressed =
      studio.Truth("  - {at: {path: 3, ring: 5}, depth_mm: 9, begin_s: 0, end_s: 2}\n", 0.8);
  EXPECT_LT(TriangulationRmse(rig, found->rig, pressed.marker_mm), 0.12);
  EXPECT_GT(TriangulationRmse(rig, model.nominal_rig, pressed.marker_mm), 1);
}

INSTANTIATE_TEST_SUITE_P(TwoMillimetresAndDegrees, MisalignedTest,
                         ::testing::Values(Misaligned{"cylinder", {2, 0, 0}, {2, 0, 0}},
                                           Misaligned{"cylinder", {0, 2, 0}, {2, 0, 0}},
                                           Misaligned{"cylinder", {0, 0, 2}, {0, 2, 0}},
                                           Misaligned{"cylinder", {0, 2, 0}, {0, 0, -2}},
                                           Misaligned{"cylinder", {-1.2, 1.2, 1.2}, {1.2, -1.2, 1.2}},
                                           Misaligned{"barrel", {2, 0, 0}, {0, 0, 2}},
                                           Misaligned{"barrel", {0, -2, 0}, {0, -2, 0}}));

TEST(PictureCalibration, OtherLensFitsAsWell) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  const Studio studio(model);
  const auto found =
      Calibrate(model, studio.Take(model.nominal_rig, studio.Truth()), {.lens = LensKind::kKannalaBrandt});
  ASSERT_TRUE(found.ok()) << found.error().message;
  EXPECT_EQ(found->rig[CameraId::kTop].lens.kind, LensKind::kKannalaBrandt);
  EXPECT_LT(found->rms_px, 0.1);
  EXPECT_LT(TriangulationRmse(model.nominal_rig, found->rig, model.RestMarkers()), 0.08);
}

TEST(PictureCalibration, ManyPairsAreAveraged) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  const Studio studio(model);
  const SkinTruth rest = studio.Truth();
  std::vector<RestPictures> pairs;
  for (const uint64_t seed : {1u, 2u, 3u, 4u}) pairs.push_back(studio.Take(model.nominal_rig, rest, seed));
  double before = -1;
  CalibrationOptions options;
  options.progress = [&](const CalibrationProgress& progress) {
    EXPECT_GE(progress.done, before);
    EXPECT_LE(progress.done, 1);
    before = progress.done;
  };
  const auto many = CalibrateFromPictures(model, pairs, options), one = Calibrate(model, pairs[0]);
  ASSERT_TRUE(many.ok() && one.ok()) << Message(many) << Message(one);
  EXPECT_EQ(before, 1);
  EXPECT_EQ(many->pairs, 4);
  EXPECT_LT(many->rms_px, one->rms_px);
  // One of the pairs with a touched skin is no rest.
  pairs[2] = studio.Take(model.nominal_rig,
                         studio.Truth("  - {at: {path: 7, ring: 5}, depth_mm: 4, begin_s: 0, end_s: 2}\n"));
  EXPECT_THAT(Message(CalibrateFromPictures(model, pairs)), HasSubstr("the skin moved"));
}

class RefusalTest : public ::testing::Test {
 protected:
  LinkModel With(void (*change)(LinkModel&)) const {
    LinkModel other = model_;
    change(other);
    return other;
  }
  const LinkModel model_ = LoadLinkModel("cylinder").value();
  const Studio studio_{model_};
  const PicturePair rest_ = studio_.Take(model_.nominal_rig, studio_.Truth());
};

TEST_F(RefusalTest, OtherGridsAreRefused) {
  const auto rings = [](LinkModel& model, int count, double first, double pitch) {
    model.markers.rings_z_mm.clear();
    for (int j = 0; j < count; ++j) model.markers.rings_z_mm.push_back(first + j * pitch);
  };
  const auto refused = [&](const LinkModel& other) { return Message(Calibrate(other, rest_)); };
  LinkModel other = model_;
  rings(other, 9, 18, 18);  // one ring less at the far end
  EXPECT_THAT(refused(other), HasSubstr("refused"));
  rings(other, 9, 19.8, 19.8);  // nine rings spread over the same length
  EXPECT_THAT(refused(other), HasSubstr("refused"));
  rings(other, 11, 16.5, 16.5);
  EXPECT_THAT(refused(other), HasSubstr("refused"));
  rings(other, 11, 18, 18);  // a longer link of the same pitch
  other.length_mm = 216;
  other.nominal_rig[CameraId::kBottom].camera_from_link.translation.z() += 18;
  EXPECT_THAT(refused(other), HasSubstr("refused"));
  for (const int paths : {12, 22, 23, 25, 48}) {
    other = model_;
    other.markers.paths = paths;
    EXPECT_THAT(refused(other), HasSubstr("refused")) << paths;
  }
  EXPECT_THAT(refused(LoadLinkModel("barrel").value()), HasSubstr("refused"));
}

TEST_F(RefusalTest, OtherRadiusIsRefused) {
  for (const double radius : {30.0, 44.0}) {
    LinkModel other = model_;
    other.profile = RadiusProfile::Constant(radius);
    EXPECT_THAT(Message(Calibrate(other, rest_)), HasSubstr("refused")) << radius;
  }
}

TEST_F(RefusalTest, SwappedPicturesAreToldFromRightOnes) {
  const auto found = Calibrate(model_, {rest_[1], rest_[0]});
  EXPECT_THAT(Message(found), HasSubstr("look swapped"));
  EXPECT_EQ(Message(Calibrate(model_, rest_)), "accepted");
}

TEST_F(RefusalTest, MirroredAndTurnedPicturesAreNamed) {
  const auto refused = [&](CameraId id, int flip) {
    PicturePair pair = {rest_[0].clone(), rest_[1].clone()};
    cv::flip(rest_[Index(id)], pair[Index(id)], flip);
    return Message(Calibrate(model_, pair));
  };
  EXPECT_THAT(refused(CameraId::kTop, 0), HasSubstr("the top picture looks mirrored, upside down"));
  EXPECT_THAT(refused(CameraId::kTop, -1), HasSubstr("the top picture looks turned by 180 degrees"));
  EXPECT_THAT(refused(CameraId::kBottom, 1), HasSubstr("the bottom picture looks mirrored, left and right"));
  EXPECT_THAT(refused(CameraId::kBottom, 0), HasSubstr("the bottom picture looks mirrored, upside down"));
  EXPECT_THAT(refused(CameraId::kBottom, -1), HasSubstr("the bottom picture looks turned by 180 degrees"));
}

TEST_F(RefusalTest, OnePictureForBothCamerasIsRefused) {
  EXPECT_THAT(Message(Calibrate(model_, {rest_[0], rest_[0]})), HasSubstr("are the same image"));
}

TEST_F(RefusalTest, TouchedSkinIsRefused) {
  const auto refused = [&](double depth_mm) {
    const auto truth = studio_.Truth("  - {at: {path: 7, ring: 5}, patch_diameter_mm: 20, depth_mm: " +
                                     std::to_string(depth_mm) + ", begin_s: 0, end_s: 2}\n");
    return Message(Calibrate(model_, studio_.Take(model_.nominal_rig, truth)));
  };
  EXPECT_THAT(refused(1), ::testing::ContainsRegex("touched near path [678], ring [456]"));
  EXPECT_THAT(refused(3), ::testing::ContainsRegex("touched near path [678], ring [456]"));
  EXPECT_THAT(refused(10), HasSubstr("touche"));
}

TEST_F(RefusalTest, SmoothErrorsOfTheMouldAreNoTouch) {
  SkinTruth truth = studio_.Truth();
  for (size_t m = 0; m < truth.marker_mm.size(); ++m) {
    const Vec3 place = truth.marker_mm[m];
    const double angle = std::atan2(place.y(), place.x()), along = kPi * place.z() / model_.length_mm;
    const double out_mm = 0.15 * std::cos(2 * angle + 1) * std::sin(along) +
                          0.15 * std::cos(4 * angle) * std::sin(2 * along) + 0.1 * std::cos(3 * angle + 2) +
                          0.1 * std::cos(5 * angle) * std::sin(3 * along);
    const Vec3 shift = out_mm * Vec3(std::cos(angle), std::sin(angle), 0);
    truth.marker_mm[m] += shift;
    truth.marker_wall_mm[m] += shift;
  }
  EXPECT_EQ(Message(Calibrate(model_, studio_.Take(model_.nominal_rig, truth))), "accepted");
}

struct Touched {
  std::string model;
  double kpa;
  int path, ring;  // counted from 1
  double force_n;
  double mount = 1;  // how far the cameras are off their nominal places
};

// What the calibration says of a nonlinear skin under these contacts, seen by cameras that are mounted off
// their nominal places.
std::string MessageWhenTouched(const LinkModel& model, double kpa, const std::string& contacts,
                               double mount = 1) {
  char head[200];
  std::snprintf(head, sizeof head,
                "taclink_scene: 1\nname: touched\nmodel: %s\nframe_rate_hz: 10\nduration_s: 2\n"
                "pressure_kpa: %g\ncontacts:\n",
                model.name.c_str(), kpa);
  SkinTruth truth;
  SimulatedSkin::Make(model, ParseScene("touched", head + contacts).value()).value()->Evaluate(1, truth);
  StereoRig rig = model.nominal_rig;
  Misalign(rig[CameraId::kTop], mount * Vec3(0.7, -0.4, 0.5), mount * Vec3(0.6, -0.3, 0.4));
  Misalign(rig[CameraId::kBottom], mount * Vec3(-0.3, 0.6, -0.8), mount * Vec3(-0.2, 0.7, -0.5));
  const PicturePair images = Studio(model).Take(rig, truth);
  const auto estimator = MakeStateEstimator(model, {});
  RestConditions rest{.loads = {}, .skin = estimator->AtRest()};
  rest.loads.pressure_mpa = 1e-3 * kpa;
  const auto found = CalibrateFromPictures(model, {&images, 1}, rest);
  return found ? "accepted" : found.error().message;
}

std::string ContactAt(int path, int ring, double force_n) {
  char text[120];
  std::snprintf(text, sizeof text,
                "  - {at: {path: %d, ring: %d}, force_n: %g, begin_s: 0, end_s: 2, ramp_s: 0.01}\n", path,
                ring, force_n);
  return text;
}

class TouchedTest : public ::testing::TestWithParam<Touched> {};

TEST_P(TouchedTest, IsRefusedWithItsPlace) {
  const auto& [name, kpa, path, ring, force_n, mount] = GetParam();
  EXPECT_THAT(
      MessageWhenTouched(LoadLinkModel(name).value(), kpa, ContactAt(path, ring, force_n), mount),
      HasSubstr("touched near path " + std::to_string(path) + ", ring " + std::to_string(ring) + ":"));
}

TEST_F(RefusalTest, WhatTouchesAllAroundIsRefusedWithItsRing) {
  for (const double kpa : {0.0, 0.5}) {
    std::string band;
    for (int path = 1; path <= model_.markers.paths; path += 2) band += ContactAt(path, 4, 0.06);
    EXPECT_THAT(MessageWhenTouched(model_, kpa, band), HasSubstr("touched all around at ring 4:")) << kpa;
  }
}

INSTANTIATE_TEST_SUITE_P(
    WeakAndStrong, TouchedTest,
    ::testing::Values(Touched{"cylinder", 0, 7, 5, 0.08}, Touched{"cylinder", 0, 7, 5, 0.08, 0},
                      Touched{"cylinder", 0, 7, 5, 0.15}, Touched{"cylinder", 0, 14, 3, 0.25},
                      Touched{"cylinder", 0, 14, 10, 0.05}, Touched{"cylinder", 0.5, 1, 8, 0.05},
                      Touched{"cylinder", 0.5, 9, 4, 0.6}, Touched{"barrel", 0, 4, 11, 0.08},
                      Touched{"barrel", 0.5, 9, 16, 0.08}));

TEST_F(RefusalTest, InflatedSkinIsRefused) {
  for (const double kpa : {0.75, 1.2}) {
    EXPECT_THAT(Message(Calibrate(model_, studio_.Take(model_.nominal_rig, studio_.Truth("", kpa)))),
                HasSubstr("under pressure"))
        << kpa;
  }
}

TEST_F(RefusalTest, UselessPicturesAreRefusedWithTheReason) {
  const cv::Mat black(480, 640, CV_8UC1, cv::Scalar(10)), small(240, 320, CV_8UC1, cv::Scalar(10));
  EXPECT_THAT(Message(Calibrate(model_, {black, rest_[1]})), HasSubstr("top camera: only 0 of 240 markers"));
  EXPECT_THAT(Message(Calibrate(model_, {rest_[0], small})), HasSubstr("the bottom picture is 320 x 240 px"));
  cv::Mat half = rest_[0].clone();
  half.colRange(0, 330).setTo(10);
  EXPECT_THAT(Message(Calibrate(model_, {half, rest_[1]})), HasSubstr("top camera"));
  EXPECT_THAT(Message(CalibrateFromPictures(model_, {})), HasSubstr("no rest pictures"));
}

}  // namespace
}  // namespace taclink
