// Following markers from frame to frame, through the whole pipeline, against the simulation's truth.
#include <gtest/gtest.h>

#include <algorithm>

#include "sensing/pipeline/link_pipeline.h"
#include "tests/support/moving_skin.h"

namespace taclink {
namespace {

constexpr double kFrameS = 1 / 30.0;

Scene SceneOf(const std::string& model) {
  Scene scene;
  scene.skin = SkinKind::kLinear;
  scene.name = "test";
  scene.model = model;
  scene.duration_s = 60;
  scene.pressure = {{0, 0}};
  return scene;
}

// Comes in at up to 30 mm/s, slides, and leaves as fast.
SceneContact Dent(double angle_rad, double z_mm, double depth_mm, double begin_s, double end_s) {
  SceneContact contact;
  contact.at = {.angle_rad = angle_rad, .z_mm = z_mm};
  contact.move_to = SkinPlace{.angle_rad = angle_rad + 0.2, .z_mm = z_mm + 15};
  contact.patch_diameter_mm = 12;
  contact.depth_mm = depth_mm;
  contact.begin_s = begin_s;
  contact.end_s = end_s;
  contact.ramp_s = 1.5 * depth_mm / 30;
  return contact;
}

class TrackingTest : public ::testing::TestWithParam<std::string> {
 protected:
  void Start(const Scene& scene) {
    skin_.emplace(GetParam(), scene);
    PipelineOptions options;
    options.rest_frames = 2;
    options.rig = skin_->model.nominal_rig;
    options.force.model = force_model_;
    pipeline_.emplace(skin_->model, options);
    for (int k = 0; k < options.rest_frames; ++k) Step(0);
    ASSERT_TRUE(pipeline_->calibration().has_value()) << state_.status_reason;
    Step(0);
    ASSERT_EQ(state_.tracking.mode, TrackingMode::kAcquired);
    ASSERT_EQ(state_.tracking.reason, AcquireReason::kFirst);
  }

  void Step(double time_s) { pipeline_->Process(skin_->Take(time_s, sequence_++), state_); }

  // Frames from begin to end.
  MovingSkin::Score Play(double begin_s, double end_s) {
    MovingSkin::Score all;
    acquired_ = 0;
    for (double t = begin_s; t < end_s; t += kFrameS) {
      Step(t);
      acquired_ += state_.tracking.mode == TrackingMode::kAcquired ? 1 : 0;
      const auto score = skin_->Judge(pipeline_->labels());
      all.visible += score.visible;
      all.labelled += score.labelled;
      all.wrong += score.wrong;
    }
    return all;
  }

  std::optional<MovingSkin> skin_;
  std::optional<ForceModel> force_model_ = ForceModel::kPressurised;  // these skins are linear
  std::optional<LinkPipeline> pipeline_;
  LinkState state_;
  uint64_t sequence_ = 0;
  int acquired_ = 0;
};

TEST_P(TrackingTest, AtRestMarkersAreOnlyVerified) {
  Start(SceneOf(GetParam()));
  const auto score = Play(0, 1);
  EXPECT_EQ(acquired_, 0);
  EXPECT_EQ(score.wrong, 0);
  EXPECT_GE(score.labelled, 0.97 * score.visible);
  for (const CameraTracking& camera : state_.tracking.cameras) {
    EXPECT_GE(camera.verified, 0.95 * skin_->model.markers.count());
    EXPECT_LE(camera.measured, 5);
    EXPECT_GT(camera.share_read, 0.005);
    EXPECT_LT(camera.share_read, 0.2);
  }
}

TEST_P(TrackingTest, NothingDriftsAtRestAndAfterTouches) {
  Scene scene = SceneOf(GetParam());
  scene.contacts = {Dent(1, 0.4 * 198, 6, 1, 2), Dent(4, 0.6 * 198, 8, 3, 4)};
  Start(scene);
  const LabelledMarkers first = pipeline_->labels();
  Play(0, 5);
  for (int k = 0; k < 300; ++k) Step(0);
  for (size_t c = 0; c < kCameraCount; ++c) {
    Vec2 mean = Vec2::Zero();
    double square = 0;
    int count = 0;
    for (size_t m = 0; m < first.cameras[c].size(); ++m) {
      const auto &now = pipeline_->labels().cameras[c][m], &before = first.cameras[c][m];
      if (!now.seen || !before.seen || before.sigma_px() > 1) continue;  // clipped ones tell little
      const Vec2 off = now.center_px - before.center_px;
      EXPECT_LT(off.norm(), 0.6) << Name(kBothCameras[c]) << " " << m;
      mean += off;
      square += off.squaredNorm();
      ++count;
    }
    EXPECT_LT((mean / count).norm(), 0.02);
    EXPECT_LT(std::sqrt(square / count), 0.12);
  }
}

TEST_P(TrackingTest, FastDeepDentsAreFollowed) {
  force_model_.reset();  // as deep as that, the cheaper model expects markers elsewhere
  Scene scene = SceneOf(GetParam());
  scene.pressure = {{0, 0}, {1, 1}, {2, 1}, {3, 0}};
  scene.contacts = {Dent(1, 70, 12, 0.2, 2), Dent(3, 110, 8, 0.8, 2.6)};
  Start(scene);
  const auto score = Play(0, 3);
  // Not even where two far markers share a spot for some frames.
  EXPECT_EQ(score.wrong, 0);
  EXPECT_GE(score.labelled, 0.88 * score.visible);
  EXPECT_LE(acquired_, 2);
}

TEST_P(TrackingTest, JitterOfTheMarkersIsNoLoss) {
  Scene scene = SceneOf(GetParam());
  scene.camera.marker_jitter_px = 0.3;
  Start(scene);
  const auto score = Play(0, 1);
  EXPECT_EQ(acquired_, 0);
  EXPECT_EQ(score.wrong, 0);
  EXPECT_GE(score.labelled, 0.88 * score.visible);
}

TEST_P(TrackingTest, LightOfTwiceAndHalfIsNoLoss) {
  Scene scene = SceneOf(GetParam());
  Start(scene);
  for (const double exposure : {0.5, 1.0, 1.5, 0.75}) {
    CameraEffects effects = scene.camera;
    effects.exposure = exposure;
    skin_->renderer = std::make_unique<Renderer>(skin_->model, skin_->model.nominal_rig, effects, 5);
    const auto score = Play(0, 2.5 * kFrameS);
    EXPECT_EQ(acquired_, 0) << exposure;
    EXPECT_EQ(score.wrong, 0) << exposure;
    EXPECT_GE(score.labelled, 0.93 * score.visible) << exposure;
  }
}

TEST_P(TrackingTest, LossIsAcquiredAnewInTheSameFrame) {
  Scene scene = SceneOf(GetParam());
  scene.contacts = {Dent(1, 90, 9, 1, 20)};
  Start(scene);
  Play(0, 0.2);
  Step(5);  // the whole dent within one frame
  EXPECT_EQ(skin_->Judge(pipeline_->labels()).wrong, 0);
  const LabelledMarkers jumped = pipeline_->labels();
  EXPECT_GE(skin_->Judge(jumped).labelled, 0.75 * skin_->Judge(jumped).visible);
}

// Few markers are lost then, but what the prediction has there is a dent that is gone, and the next ring's
// spots are where its markers were.
TEST_P(TrackingTest, ABodyThatLetsGoWithinAFrameLeavesNothing) {
  force_model_.reset();
  Scene scene = SceneOf(GetParam());
  scene.skin = SkinKind::kNonlinear;
  scene.pressure = {{0, 1}};
  SceneContact body;
  body.at = {.angle_rad = RadFromDeg(23.8), .z_mm = 81.9};
  body.patch_diameter_mm = 8;
  body.force_n = 0.59;
  body.begin_s = 1;
  body.end_s = 2;
  body.ramp_s = 0.02;
  scene.contacts = {body};
  Start(scene);
  for (int tap = 0; tap < 8; ++tap) {
    for (const double s : {1.3, 1.4, 1.5, 1.6}) Step(s);
    EXPECT_EQ(state_.contacts.size(), 1u) << "tap " << tap;
    Step(2.5);
    EXPECT_EQ(skin_->Judge(pipeline_->labels()).wrong, 0) << "tap " << tap;
    EXPECT_EQ(state_.contacts.size(), 0u) << "tap " << tap;
    for (int k = 0; k < 3; ++k) Step(2.5);
  }
}

TEST_P(TrackingTest, GapAndReturnOfACameraAreAcquired) {
  Start(SceneOf(GetParam()));
  Play(0, 0.1);
  sequence_ += 10;
  Step(0.2);
  EXPECT_EQ(state_.tracking.reason, AcquireReason::kGap);

  StereoFrame one = skin_->Take(0.2, sequence_++);
  one.images[Index(CameraId::kBottom)].valid = false;
  pipeline_->Process(one, state_);
  EXPECT_EQ(state_.tracking.mode, TrackingMode::kTracked);
  EXPECT_GE(state_.cameras[Index(CameraId::kTop)].labelled, 0.9 * skin_->model.markers.count());
  EXPECT_EQ(state_.cameras[Index(CameraId::kBottom)].labelled, 0);
  Step(0.25);
  EXPECT_EQ(state_.tracking.reason, AcquireReason::kCamera);
  EXPECT_GE(state_.cameras[Index(CameraId::kBottom)].labelled, 0.75 * skin_->model.markers.count());
  Step(0.3);
  EXPECT_EQ(state_.tracking.mode, TrackingMode::kTracked);
}

INSTANTIATE_TEST_SUITE_P(ShippedModels, TrackingTest, ::testing::Values("cylinder", "barrel"));

}  // namespace
}  // namespace taclink
