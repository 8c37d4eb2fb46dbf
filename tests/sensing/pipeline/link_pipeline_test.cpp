// Status and robustness of the whole way; its numbers are in tests/accuracy.
#include "sensing/pipeline/link_pipeline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "sensing/core/similar_skin.h"
#include "sensing/model/model_file.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kTouchedS = 3;  // in the scene `press`

class LinkPipelineTest : public ::testing::Test {
 protected:
  LinkPipelineTest() {
    options_.pressure_mpa = 0;
    options_.rest_frames = 4;
  }

  StereoFrame Frame(double time_s) {
    StereoFrame frame;
    skin_->Evaluate(time_s, truth_);
    const uint64_t frame_of_scene = std::exchange(truth_.frame, frames_made_++);  // a noise of its own
    truth_.marker_is_lost.assign(lost_markers_.empty() ? 0 : truth_.marker_mm.size(), false);
    for (const int marker : lost_markers_) truth_.marker_is_lost[static_cast<size_t>(marker)] = true;
    for (const CameraId id : kBothCameras) {
      renderer_.Render(truth_, id, gray_);
      PackYuyv(gray_, renderer_.chroma(id), frame.images[Index(id)]);
    }
    frame.sequence = frame_of_scene;
    return frame;
  }

  void TakeRest(LinkPipeline& pipeline) {
    for (int k = 0; k < options_.rest_frames; ++k) pipeline.Process(Frame(k / 30.0), state_);
    ASSERT_TRUE(pipeline.calibration().has_value()) << state_.status_reason;
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  const Scene scene_ = LoadScene("press").value();
  std::unique_ptr<SimulatedSkin> skin_ = SimulatedSkin::Make(model_, scene_).value();
  Renderer renderer_{model_, model_.nominal_rig, scene_.camera, 1};
  SkinTruth truth_;
  uint64_t frames_made_ = 0;
  std::vector<int> lost_markers_;  // broken off, ascending
  cv::Mat gray_;
  PipelineOptions options_;
  LinkState state_;
};

TEST_F(LinkPipelineTest, CalibratesThenMeasures) {
  LinkPipeline pipeline(model_, options_);
  pipeline.Process(Frame(0), state_);
  EXPECT_EQ(state_.status, LinkStatus::kCalibrating);
  EXPECT_FALSE(state_.measured());
  TakeRest(pipeline);
  pipeline.Process(Frame(kTouchedS), state_);
  EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
  ASSERT_EQ(state_.contacts.size(), 1u);
  EXPECT_GT(state_.stage_ms.detect, 0);
  EXPECT_GE(state_.times.solved_ns, state_.times.tracked_ns);
}

// Between two starts of a server: its first images tell.
TEST_F(LinkPipelineTest, ACameraThatWasMountedAgainIsNamedFromTheStartOn) {
  for (const double moved_mm : {0.0, 0.4}) {
    CameraEffects effects = scene_.camera;
    effects.mount[Index(CameraId::kTop)].shift_mm = Vec3(moved_mm, 0, 0);
    options_.rig = model_.nominal_rig;
    options_.calibrated_utc_s = 1'800'000'000;
    LinkPipeline pipeline(model_, options_);
    renderer_ = Renderer(model_, MountedRig(model_.nominal_rig, effects), effects, 1);
    TakeRest(pipeline);
    pipeline.Process(Frame(0.2), state_);
    EXPECT_EQ(state_.baseline.calibrated_utc_ns, 1'800'000'000'000'000'000);
    if (moved_mm == 0) {
      EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
      continue;
    }
    EXPECT_EQ(state_.status, LinkStatus::kDegraded);
    EXPECT_THAT(state_.status_reason, HasSubstr("the top camera has moved by 0.4"));
    EXPECT_THAT(state_.status_reason, Not(HasSubstr("bottom camera has moved")));
    // New cameras mend it.
    pipeline.BeginRest(options_.rest_frames);
    for (int k = 0; k <= options_.rest_frames; ++k) pipeline.Process(Frame(k / 30.0), state_);
    EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
    EXPECT_EQ(state_.baseline.calibrated_utc_ns, state_.baseline.taken_utc_ns);
  }
}

// A pressure sensor that fell silent: measured on, but said so; no baseline is taken without it.
TEST_F(LinkPipelineTest, AStalePressureIsStated) {
  LinkPipeline pipeline(model_, options_);
  const auto with = [this](double time_s, bool stale) {
    StereoFrame frame = Frame(time_s);
    frame.pressure = {.origin = PressureOrigin::kSerial, .stale = stale, .mpa = 0, .age_ns = 0};
    if (stale) frame.pressure.trouble = "no reading for 9 s";
    if (!stale) frame.pressure_mpa = 0;
    return frame;
  };
  for (int k = 0; k < 2 * options_.rest_frames; ++k) pipeline.Process(with(k / 30.0, true), state_);
  EXPECT_EQ(state_.status, LinkStatus::kCalibrating);
  EXPECT_THAT(state_.status_reason, HasSubstr("waits for the pressure sensor: no reading for 9 s"));
  for (int k = 0; k < options_.rest_frames; ++k) pipeline.Process(with(k / 30.0, false), state_);
  pipeline.Process(with(kTouchedS, false), state_);
  EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
  ASSERT_EQ(state_.contacts.size(), 1u);
  const double fresh_n = state_.contacts[0].normal_force_n;
  pipeline.Process(with(kTouchedS + 1.0 / 30, true), state_);
  EXPECT_EQ(state_.status, LinkStatus::kDegraded);
  EXPECT_EQ(state_.status_reason, "the pressure is not known: no reading for 9 s; check the sensor");
  EXPECT_TRUE(state_.pressure.stale);
  ASSERT_EQ(state_.contacts.size(), 1u);
  EXPECT_NEAR(state_.contacts[0].normal_force_n, fresh_n, 0.3 * fresh_n);
}

TEST_F(LinkPipelineTest, AWrongModulusIsNamedWhenInflated) {
  Scene scene = LoadScene("inflate").value();
  scene.pressure = {{.time_s = 0, .kpa = 0}, {.time_s = 1, .kpa = 0}, {.time_s = 2, .kpa = 0.3}};
  scene.contacts.clear();
  skin_ = SimulatedSkin::Make(model_, scene).value();
  for (const double factor : {0.9, 1.0, 1.1}) {
    LinkModel configured = model_;
    configured.material.youngs_modulus_mpa *= factor;
    LinkPipeline pipeline(configured, options_);
    const auto process = [&](double time_s) {
      StereoFrame frame = Frame(time_s);
      frame.pressure.origin = PressureOrigin::kSerial;
      frame.pressure_mpa = truth_.pressure_mpa;
      pipeline.Process(frame, state_);
    };
    for (int k = 0; k < options_.rest_frames; ++k) process(k / 30.0);
    process(2.5);
    if (factor == 1) {
      EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
      continue;
    }
    EXPECT_EQ(state_.status, LinkStatus::kDegraded);
    ASSERT_EQ(state_.reasons.size(), 1u) << state_.status_reason;
    EXPECT_EQ(state_.reasons[0].id, ReasonId::kStiffnessMismatch);
    EXPECT_THAT(state_.status_reason, HasSubstr(factor > 1 ? "% more than" : "% less than"));
  }
}

// The baseline's pressure is that of its pictures: pictures of a skin that is being inflated are no baseline,
// and what slowly changes meanwhile is the mean.
TEST_F(LinkPipelineTest, ABaselineIsOfOnePressure) {
  Scene scene = LoadScene("inflate").value();
  scene.pressure = {{.time_s = 0, .kpa = 0}, {.time_s = 10, .kpa = 1}};
  scene.contacts.clear();
  skin_ = SimulatedSkin::Make(model_, scene).value();
  LinkPipeline pipeline(model_, options_);
  const auto process = [&](double time_s) {
    StereoFrame frame = Frame(time_s);
    frame.pressure = {.origin = PressureOrigin::kSimulated, .mpa = time_s * 1e-4, .age_ns = 0};
    frame.pressure_mpa = time_s * 1e-4;
    pipeline.Process(frame, state_);
  };
  for (const double time_s : {1.0, 2.0, 3.0}) process(time_s);
  EXPECT_EQ(state_.status, LinkStatus::kCalibrating);
  EXPECT_THAT(state_.status_reason, HasSubstr("the pressure changed from"));
  process(4.5);
  EXPECT_EQ(pipeline.rest_progress().taken, 1);
  for (const double time_s : {4.7, 4.9, 5.1}) process(time_s);
  ASSERT_TRUE(pipeline.calibration().has_value()) << state_.status_reason;
  process(7);
  EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
  EXPECT_TRUE(state_.contacts.empty());
  // With the last picture's pressure it would be 0.03 kPa less.
  ASSERT_TRUE(state_.pressure_estimate.has_value());
  EXPECT_NEAR(state_.pressure_estimate->mpa, 0.7e-3, 1e-5);
}

TEST_F(LinkPipelineTest, APressureThatNobodyTellsIsNeverOk) {
  options_.pressure_mpa.reset();
  LinkPipeline pipeline(model_, options_);
  TakeRest(pipeline);
  for (const double time_s : {0.0, kTouchedS}) {
    pipeline.Process(Frame(time_s), state_);
    ASSERT_EQ(state_.reasons.size(), 1U);
    EXPECT_EQ(state_.reasons[0].id, ReasonId::kPressureUnknown);
    EXPECT_EQ(state_.status, LinkStatus::kDegraded);
  }
  EXPECT_FALSE(state_.contacts.empty());
}

TEST_F(LinkPipelineTest, RestIsTakenAgainOnDemand) {
  LinkPipeline pipeline(model_, options_);
  TakeRest(pipeline);
  pipeline.BeginRest(3);
  for (int k = 1; k <= 3; ++k) {
    EXPECT_EQ(pipeline.rest_progress().taken, k - 1);
    pipeline.Process(Frame(k / 30.0), state_);
    EXPECT_EQ(state_.status, LinkStatus::kCalibrating);
    EXPECT_FALSE(state_.measured());
  }
  EXPECT_EQ(pipeline.rest_progress().taken, 3);
  EXPECT_FALSE(pipeline.rest_progress().refusal.has_value());
  EXPECT_EQ(pipeline.calibration()->pairs, 3);
  pipeline.Process(Frame(kTouchedS), state_);
  EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
  EXPECT_EQ(state_.contacts.size(), 1u);
}

TEST_F(LinkPipelineTest, RestGivenUpLeavesAllAsItWas) {
  LinkPipeline pipeline(model_, options_);
  TakeRest(pipeline);
  const double before = pipeline.calibration()->rms_px;
  pipeline.BeginRest(3);
  StereoFrame dark = Frame(0.5);
  for (auto& image : dark.images) std::fill(image.bytes.begin(), image.bytes.end(), uint8_t{16});
  pipeline.Process(dark, state_);
  EXPECT_TRUE(pipeline.rest_progress().refusal.has_value());
  pipeline.CancelRest();
  pipeline.Process(Frame(kTouchedS), state_);
  EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
  EXPECT_EQ(state_.contacts.size(), 1u);
  EXPECT_EQ(pipeline.calibration()->rms_px, before);
}

TEST_F(LinkPipelineTest, RestGivenUpBeforeTheFirstBaselineKeepsTheConfiguredCameras) {
  options_.rig = model_.nominal_rig;
  LinkPipeline pipeline(model_, options_);
  pipeline.BeginRest(3);
  pipeline.Process(Frame(0), state_);
  pipeline.CancelRest();
  TakeRest(pipeline);
  for (const CameraId id : kBothCameras)
    EXPECT_EQ(StepBetween(model_.nominal_rig[id], pipeline.calibration()->rig[id]), CameraStep::Zero());
}

TEST_F(LinkPipelineTest, AStalePressureIsNamedWhileRestPairsAreTaken) {
  LinkPipeline pipeline(model_, options_);
  TakeRest(pipeline);
  pipeline.BeginRest(3);
  StereoFrame frame = Frame(0.5);
  frame.pressure = {.origin = PressureOrigin::kSerial, .stale = true, .mpa = 0, .age_ns = 0};
  frame.pressure.trouble = "no reading for 9 s";
  pipeline.Process(frame, state_);
  EXPECT_THAT(pipeline.rest_progress().waiting_for, HasSubstr("no reading for 9 s"));
  EXPECT_EQ(pipeline.rest_progress().taken, 0);
  pipeline.Process(Frame(0.5), state_);
  EXPECT_EQ(pipeline.rest_progress().waiting_for, "");
  EXPECT_EQ(pipeline.rest_progress().taken, 1);
}

TEST_F(LinkPipelineTest, LostCameraIsDegradedAndSaysWhich) {
  LinkPipeline pipeline(model_, options_);
  TakeRest(pipeline);
  StereoFrame frame = Frame(0.5);
  frame.images[Index(CameraId::kBottom)].valid = false;
  pipeline.Process(frame, state_);
  EXPECT_EQ(state_.status, LinkStatus::kDegraded);
  EXPECT_THAT(state_.status_reason, HasSubstr("bottom"));
  EXPECT_TRUE(state_.contacts.empty());
}

TEST_F(LinkPipelineTest, WithOneCameraThePositionsAreKnownWorseAndTheReasonIsPassedOn) {
  LinkPipeline pipeline(model_, options_);
  TakeRest(pipeline);
  const auto mean_variance_mm2 = [this] {
    double sum = 0;
    for (const Mat3& covariance : state_.shape.covariances_mm2) sum += covariance.trace();
    return sum / static_cast<double>(state_.shape.covariances_mm2.size());
  };
  pipeline.Process(Frame(0.5), state_);
  const double both_mm2 = mean_variance_mm2();
  StereoFrame frame = Frame(0.6);
  RawImage& bottom = frame.images[Index(CameraId::kBottom)];
  bottom.valid = false;
  bottom.why_missing = "usb:1-2: lost";
  pipeline.Process(frame, state_);
  EXPECT_THAT(state_.status_reason, HasSubstr("no picture from the bottom camera: usb:1-2: lost"));
  EXPECT_GT(mean_variance_mm2(), 1.2 * both_mm2);
  EXPECT_FALSE(state_.cameras[Index(CameraId::kBottom)].bad_picture) << "there was none";
  pipeline.Process(Frame(0.7), state_);
  EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
  EXPECT_LT(mean_variance_mm2(), 1.1 * both_mm2);
}

// Deeper than forces are right.
TEST_F(LinkPipelineTest, ADeepDentIsDegraded) {
  Scene scene = LoadScene("press").value();
  scene.contacts[0].force_n.reset();
  scene.contacts[0].depth_mm = 23;
  skin_ = SimulatedSkin::Make(model_, scene).value();
  LinkPipeline pipeline(model_, options_);
  TakeRest(pipeline);
  bool was_ok = false;
  for (double time_s = 1.4; time_s < 2.1; time_s += 1.0 / 30) {
    pipeline.Process(Frame(time_s), state_);
    was_ok = was_ok || (state_.status == LinkStatus::kOk && !state_.contacts.empty());
  }
  EXPECT_TRUE(was_ok);
  EXPECT_EQ(state_.status, LinkStatus::kDegraded);
  EXPECT_THAT(state_.status_reason, HasSubstr("beyond 20 mm forces come out too small"));
  EXPECT_TRUE(state_.measured());
}

TEST_F(LinkPipelineTest, SwappedCamerasAreRefusedAtTheStart) {
  LinkPipeline pipeline(model_, options_);
  for (int k = 0; k < options_.rest_frames; ++k) {
    StereoFrame frame = Frame(k / 30.0);
    std::swap(frame.images[0], frame.images[1]);
    pipeline.Process(frame, state_);
  }
  EXPECT_EQ(state_.status, LinkStatus::kCalibrating);
  EXPECT_THAT(state_.status_reason, HasSubstr("look swapped"));
}

TEST_F(LinkPipelineTest, SwappedCamerasOfAKnownLinkAreNamed) {
  options_.rig = model_.nominal_rig;
  LinkPipeline pipeline(model_, options_);
  TakeRest(pipeline);
  for (int k = 0; k < 5; ++k) {
    StereoFrame frame = Frame(0.5 + k / 30.0);
    std::swap(frame.images[0], frame.images[1]);
    pipeline.Process(frame, state_);
    EXPECT_NE(state_.status, LinkStatus::kOk);
  }
  ASSERT_FALSE(state_.reasons.empty());
  EXPECT_EQ(state_.reasons.front().id, ReasonId::kCamerasSwapped) << state_.status_reason;
  EXPECT_FALSE(state_.measured());
  LinkPipeline restarted(model_, options_);
  for (int k = 0; k < options_.rest_frames; ++k) {
    StereoFrame frame = Frame(k / 30.0);
    std::swap(frame.images[0], frame.images[1]);
    restarted.Process(frame, state_);
  }
  EXPECT_EQ(state_.status, LinkStatus::kCalibrating);
  EXPECT_THAT(state_.status_reason, HasSubstr("exchange their cables"));
}

TEST_F(LinkPipelineTest, OneCameraForBothIsNamed) {
  LinkPipeline pipeline(model_, options_);
  TakeRest(pipeline);
  StereoFrame frame = Frame(0.5);
  frame.images[1] = frame.images[0];
  pipeline.Process(frame, state_);
  EXPECT_EQ(state_.status, LinkStatus::kLost);
  EXPECT_THAT(state_.status_reason, HasSubstr("both cameras give the same image"));
}

TEST_F(LinkPipelineTest, MarkersThatAreGoneForGoodAreListedAndDegradeNothing) {
  lost_markers_ = {model_.MarkerIndex(2, 1), model_.MarkerIndex(7, 4), model_.MarkerIndex(7, 5)};
  LinkPipeline pipeline(model_, options_);
  TakeRest(pipeline);
  pipeline.Process(Frame(kTouchedS), state_);
  EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
  EXPECT_EQ(state_.contacts.size(), 1u);
  EXPECT_EQ(state_.baseline.missing_markers, lost_markers_);
}

// A sensor's noise never repeats: what it saw before says nothing of now.
TEST_F(LinkPipelineTest, APictureThatRepeatsIsToldAndNotUsed) {
  LinkPipeline pipeline(model_, options_);
  TakeRest(pipeline);
  const StereoFrame before = Frame(0.5);
  pipeline.Process(before, state_);
  ASSERT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
  StereoFrame frame = Frame(kTouchedS);
  frame.images[Index(CameraId::kTop)] = before.images[Index(CameraId::kTop)];
  pipeline.Process(frame, state_);
  EXPECT_EQ(state_.status, LinkStatus::kDegraded);
  ASSERT_FALSE(state_.reasons.empty());
  EXPECT_EQ(state_.reasons.front().id, ReasonId::kFrozen);
  EXPECT_THAT(state_.status_reason, HasSubstr("top camera"));
  EXPECT_NEAR(state_.total_force_n.norm(), 0.2, 0.04) << "what the other camera sees";
  EXPECT_EQ(state_.shape.CountOf(MarkerSource::kTop) + state_.shape.CountOf(MarkerSource::kBoth), 0);
  EXPECT_FALSE(state_.cameras[Index(CameraId::kTop)].bad_picture) << "it could be read";
  const StereoFrame again = frame;
  pipeline.Process(again, state_);
  EXPECT_EQ(state_.status, LinkStatus::kLost) << "now both repeat";
  EXPECT_FALSE(state_.measured());
  EXPECT_TRUE(std::any_of(state_.reasons.begin(), state_.reasons.end(),
                          [](const Reason& reason) { return reason.id == ReasonId::kFrozen; }));
  pipeline.Process(Frame(kTouchedS), state_);
  EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
}

TEST_F(LinkPipelineTest, DarkPicturesAreLostNotZero) {
  LinkPipeline pipeline(model_, options_);
  TakeRest(pipeline);
  StereoFrame frame = Frame(0.5);
  for (auto& image : frame.images) std::fill(image.bytes.begin(), image.bytes.end(), uint8_t{16});
  pipeline.Process(frame, state_);
  EXPECT_EQ(state_.status, LinkStatus::kLost);
  EXPECT_THAT(state_.status_reason, HasSubstr("0 of 240"));
  EXPECT_FALSE(state_.measured());
  pipeline.Process(Frame(0.6), state_);
  EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
}

TEST_F(LinkPipelineTest, ShortFrameIsNamed) {
  LinkPipeline pipeline(model_, options_);
  TakeRest(pipeline);
  StereoFrame frame = Frame(0.5);
  frame.images[Index(CameraId::kTop)].bytes.resize(1000);
  pipeline.Process(frame, state_);
  EXPECT_EQ(state_.status, LinkStatus::kDegraded);
  EXPECT_THAT(state_.status_reason, HasSubstr("top"));
  EXPECT_TRUE(state_.cameras[Index(CameraId::kTop)].bad_picture);
  EXPECT_FALSE(state_.cameras[Index(CameraId::kBottom)].bad_picture);
}

TEST_F(LinkPipelineTest, TouchedSkinIsNoBaseline) {
  LinkPipeline pipeline(model_, options_);
  pipeline.Process(Frame(0), state_);
  pipeline.Process(Frame(kTouchedS), state_);
  EXPECT_THAT(state_.status_reason, HasSubstr("moved"));
  for (int k = 1; k < options_.rest_frames; ++k) pipeline.Process(Frame(kTouchedS), state_);
  EXPECT_FALSE(pipeline.calibration().has_value());
  EXPECT_EQ(state_.status, LinkStatus::kCalibrating);
  EXPECT_THAT(state_.status_reason, HasSubstr("touch"));
}

// Of every marker, the outer rings among them.
TEST_F(LinkPipelineTest, EveryMarkerHasALimitOfDetection) {
  for (const std::string& name : ShippedModelNames()) {
    const LinkModel model = LoadLinkModel(name).value();
    for (const int refinement : {0, 1}) {
      ForceOptions options;
      options.refinement = refinement;
      StateEstimator estimator(model, options);
      SkinShape shape;
      shape.sources.assign(static_cast<size_t>(model.markers.count()), MarkerSource::kBoth);
      shape.measured.assign(shape.sources.size(), {Vec3::Zero(), Mat3::Identity() / (0.05 * 0.05)});
      NodalForces forces;
      estimator.Estimate({.now = {0, 5e-5}, .baseline = {}}, shape, forces);
      ASSERT_TRUE(forces.converged);
      ASSERT_EQ(forces.limits_n.size(), shape.sources.size());
      const double unit = ForceUnit(model);
      for (const double limit_n : forces.limits_n) {
        ASSERT_GT(limit_n, 0.001 * unit) << name << ", refinement " << refinement;
        ASSERT_LT(limit_n, 1 * unit) << name << ", refinement " << refinement;
      }
    }
  }
}

// Whoever looks between two tries must see what is missing.
TEST_F(LinkPipelineTest, ARefusalStaysToBeReadWhileMorePairsAreTaken) {
  LinkPipeline pipeline(model_, options_);
  StereoFrame frame = Frame(kTouchedS);
  frame.pressure_mpa = 1e-3;
  for (int k = 0; k < options_.rest_frames; ++k) pipeline.Process(frame, state_);
  const std::string refusal = state_.status_reason;
  EXPECT_THAT(refusal, HasSubstr("refused"));
  EXPECT_THAT(refusal, HasSubstr("under 1.000 kPa: cameras are calibrated without"));
  for (int k = 0; k < 3; ++k) pipeline.Process(frame, state_);
  EXPECT_EQ(state_.status_reason, "taking the rest shape again. Before: " + refusal);
  for (int k = 0; k < 2 * options_.rest_frames && !pipeline.calibration(); ++k)
    pipeline.Process(Frame(k / 30.0), state_);
  EXPECT_TRUE(pipeline.calibration().has_value()) << state_.status_reason;
}

// On a busy machine, what takes long must wait until the skin is known to rest, or it is never seen at rest.
TEST_F(LinkPipelineTest, AMovingSkinIsToldAtOnceAndBeginsWhereItComesToRest) {
  LinkPipeline pipeline(model_, options_);
  for (int k = 0; k < 6; ++k) pipeline.Process(Frame(k % 2 == 0 ? kTouchedS : 0), state_);
  EXPECT_THAT(state_.status_reason, HasSubstr("moved"));
  EXPECT_EQ(pipeline.rest_progress().taken, 1) << "this pair is the first of the next";
  for (int k = 1; k < options_.rest_frames; ++k) pipeline.Process(Frame(0), state_);
  EXPECT_TRUE(pipeline.calibration().has_value()) << state_.status_reason;
}

// Also where the cameras are known: what touches at the start would be missing while it stays, and a ghost
// afterwards.
TEST_F(LinkPipelineTest, TouchedSkinIsNoBaselineOfKnownCameras) {
  options_.rig = model_.nominal_rig;
  LinkPipeline pipeline(model_, options_);
  for (int k = 0; k < options_.rest_frames; ++k) pipeline.Process(Frame(kTouchedS), state_);
  EXPECT_EQ(state_.status, LinkStatus::kCalibrating);
  EXPECT_THAT(state_.status_reason, HasSubstr("the skin is touched near path"));
  for (int k = 0; k < options_.rest_frames; ++k) pipeline.Process(Frame(0), state_);
  pipeline.Process(Frame(0), state_);
  EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
  pipeline.Process(Frame(kTouchedS), state_);
  EXPECT_NEAR(state_.total_force_n.norm(), 0.2, 0.04);
}

// Recursive noise reduction: y(t) = a y(t-1) + (1 - a) x(t).
TEST_F(LinkPipelineTest, ACameraThatBlendsImagesIsNamed) {
  options_.rest_frames = 8;
  options_.pictures_may_repeat = true;  // files, too
  LinkPipeline pipeline(model_, options_);
  cv::Mat blended;
  for (int k = 0; k < 12; ++k) {
    StereoFrame frame = Frame(0);  // leaves the bottom image in gray_
    if (blended.empty()) gray_.convertTo(blended, CV_32F);
    cv::accumulateWeighted(gray_, blended, 0.5);
    cv::Mat sent;
    blended.convertTo(sent, CV_8U);
    PackYuyv(sent, renderer_.chroma(CameraId::kBottom), frame.images[Index(CameraId::kBottom)]);
    pipeline.Process(frame, state_);
  }
  ASSERT_EQ(state_.reasons.size(), 1U) << state_.status_reason;
  EXPECT_EQ(state_.reasons[0].id, ReasonId::kTemporalSmoothing);
  EXPECT_THAT(state_.status_reason, HasSubstr("the bottom camera blends"));
  EXPECT_NEAR(state_.reasons[0].value.value(), 0.5, 0.1);
}

// By 2 px, the cameras with each other.
TEST_F(LinkPipelineTest, AKnockThatMovesBothCamerasIsNamed) {
  LinkPipeline pipeline(model_, options_);
  TakeRest(pipeline);
  const cv::Mat shift = (cv::Mat_<double>(2, 3) << 1, 0, 2, 0, 1, 0.6);
  for (int k = 0; k < 9; ++k) {
    StereoFrame frame = Frame(0.1 + k / 30.0);
    for (const CameraId id : kBothCameras) {
      renderer_.Render(truth_, id, gray_);
      cv::warpAffine(gray_, gray_, shift, gray_.size(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
      PackYuyv(gray_, renderer_.chroma(id), frame.images[Index(id)]);
    }
    pipeline.Process(frame, state_);
    EXPECT_NE(state_.status, LinkStatus::kOk);
  }
  ASSERT_FALSE(state_.reasons.empty());
  EXPECT_EQ(state_.reasons[0].id, ReasonId::kCamerasMoved);
  EXPECT_THAT(state_.status_reason,
              ::testing::AllOf(HasSubstr("top camera's image is shifted by 2.0, 0.6 px"),
                               HasSubstr("bottom camera's image is shifted by 2.0")));
}

// The cameras agree, and what they show may be inflation.
TEST_F(LinkPipelineTest, ImagesThatGrowAreNamed) {
  LinkPipeline pipeline(model_, options_);
  TakeRest(pipeline);
  for (const double scale : {1.001, 1.008}) {
    for (int k = 0; k < 10; ++k) {
      StereoFrame frame = Frame(0.1 + k / 30.0);
      for (const CameraId id : kBothCameras) {
        renderer_.Render(truth_, id, gray_);
        const cv::Mat grown = cv::getRotationMatrix2D(
            {static_cast<float>(gray_.cols - 1) / 2, static_cast<float>(gray_.rows - 1) / 2}, 0, scale);
        cv::warpAffine(gray_, gray_, grown, gray_.size(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
        PackYuyv(gray_, renderer_.chroma(id), frame.images[Index(id)]);
      }
      pipeline.Process(frame, state_);
    }
    if (scale < 1.003)
      EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
    else
      EXPECT_THAT(state_.status_reason, ::testing::ContainsRegex("image is 0\\.[78] % larger"));
  }
}

// A drop on the lens.
TEST_F(LinkPipelineTest, AnObstructedViewIsNamedAndTheRestIsMeasured) {
  LinkPipeline pipeline(model_, options_);
  TakeRest(pipeline);
  StereoFrame frame = Frame(kTouchedS);
  renderer_.Render(truth_, CameraId::kTop, gray_);
  const cv::Rect part(400, 190, 100, 100);
  cv::Mat magnified;
  cv::resize(gray_(part), magnified, {}, 1.04, 1.04, cv::INTER_CUBIC);
  magnified(cv::Rect(2, 2, part.width, part.height)).copyTo(gray_(part));
  PackYuyv(gray_, renderer_.chroma(CameraId::kTop), frame.images[0]);
  pipeline.Process(frame, state_);
  EXPECT_EQ(state_.status, LinkStatus::kDegraded);
  EXPECT_THAT(state_.status_reason, HasSubstr("the top camera alone shows"));
  EXPECT_NEAR(state_.total_force_n.norm(), 0.2, 0.04);
}

// Nor where they are calibrated from the same images; the link begins once the skin is released.
TEST_F(LinkPipelineTest, TouchedSkinCalibratesNoCameras) {
  LinkPipeline pipeline(model_, options_);
  for (int k = 0; k < options_.rest_frames; ++k) pipeline.Process(Frame(kTouchedS), state_);
  EXPECT_EQ(state_.status, LinkStatus::kCalibrating);
  EXPECT_THAT(state_.status_reason, HasSubstr("the skin is touched near path"));
  TakeRest(pipeline);
  pipeline.Process(Frame(kTouchedS), state_);
  EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
  EXPECT_NEAR(state_.total_force_n.norm(), 0.2, 0.04);
}

// Nor is pressure a touch, or a lens that dirt covers in part.
TEST_F(LinkPipelineTest, PressureAndDirtAreNoTouchOfKnownCameras) {
  Scene inflated = scene_;
  inflated.pressure = {{0, 1.5}};
  inflated.camera.dirt_specks = 6;
  skin_ = SimulatedSkin::Make(model_, inflated).value();
  options_.rig = model_.nominal_rig;
  options_.pressure_mpa = 1.5e-3;
  renderer_ = Renderer(model_, model_.nominal_rig, inflated.camera, 3);
  LinkPipeline pipeline(model_, options_);
  for (int k = 0; k <= options_.rest_frames; ++k) pipeline.Process(Frame(0), state_);
  EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
}

TEST_F(LinkPipelineTest, RefusedRestIsTriedAgainAtGrowingIntervalsAndBeginsWithinASecond) {
  LinkPipeline pipeline(model_, options_);
  constexpr int64_t kFrameNs = 33'333'333;
  int64_t now_ns = 0, good_from_ns = 0;
  int tried = 0;
  const auto process = [&](StereoFrame frame) {
    frame.times.exposure_monotonic_ns = now_ns += kFrameNs;
    pipeline.Process(frame, state_);
  };
  StereoFrame dark = Frame(0);
  for (auto& image : dark.images) std::fill(image.bytes.begin(), image.bytes.end(), uint8_t{16});
  for (int k = 0; k < 90; ++k) {
    process(dark);
    EXPECT_EQ(state_.status, LinkStatus::kCalibrating);
    EXPECT_FALSE(state_.status_reason.empty());
    tried += state_.stage_ms.detect > 0 ? 1 : 0;
  }
  EXPECT_GE(tried, 5);
  EXPECT_LE(tried, 10);
  good_from_ns = now_ns;
  while (!pipeline.calibration() && now_ns < good_from_ns + 2'000'000'000) process(Frame(0));
  EXPECT_TRUE(pipeline.calibration().has_value()) << state_.status_reason;
  EXPECT_LT(now_ns - good_from_ns, 1'000'000'000);
}

TEST_F(LinkPipelineTest, PicturesOfAnotherModelAreRefused) {
  LinkPipeline pipeline(LoadLinkModel("barrel").value(), options_);
  for (int k = 0; k < options_.rest_frames; ++k) pipeline.Process(Frame(0), state_);
  EXPECT_FALSE(pipeline.calibration().has_value());
  EXPECT_EQ(state_.status, LinkStatus::kCalibrating);
  EXPECT_FALSE(state_.status_reason.empty());
}

}  // namespace
}  // namespace taclink
