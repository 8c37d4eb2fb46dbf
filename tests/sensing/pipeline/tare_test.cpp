// Tares of a simulated link: a new baseline with the cameras as they are, and a baseline that follows creep.
#include "sensing/pipeline/tare.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "sensing/pipeline/link_pipeline.h"
#include "tests/support/moving_skin.h"

namespace taclink {
namespace {

using ::testing::HasSubstr;

constexpr double kTareFrameS = 1 / 30.0;
constexpr double kFreeS = 0.5, kTareTouchedS = 3;  // of the scene

class FrameClock final : public Clock {
 public:
  int64_t MonotonicNs() const override { return now_ns; }
  int64_t UtcNs() const override { return now_ns + 1'700'000'000'000'000'000; }
  void SleepUntilMonotonicNs(int64_t) override {}
  int64_t now_ns = 1'000'000'000;
};

class TareTest : public ::testing::Test {
 protected:
  static Scene TouchScene() {
    Scene scene;
    scene.model = "cylinder";
    scene.duration_s = 40;
    scene.pressure = {{0, 0}};
    SceneContact contact;
    contact.at = {.path = 7, .ring = 5};
    contact.force_n = 0.2;
    contact.begin_s = 1.5;
    contact.end_s = 30;
    contact.ramp_s = 0.5;
    scene.contacts = {contact};
    return scene;
  }
  static PipelineOptions Options() {
    PipelineOptions options;
    options.rest_frames = 4;
    return options;
  }

  void Start(const Scene& scene, const PipelineOptions& options = Options()) {
    skin_ = std::make_unique<MovingSkin>("cylinder", scene);
    pipeline_ = std::make_unique<LinkPipeline>(skin_->model, options, clock_);
    for (int k = 0; k <= options.rest_frames; ++k) Process(0);
    ASSERT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
  }
  void Process(double time_s) {
    clock_.now_ns += static_cast<int64_t>(kTareFrameS * 1e9);
    skin_->Take(time_s, sequence_++);
    skin_->frame.times.exposure_monotonic_ns = clock_.now_ns;
    skin_->frame.pressure_mpa.reset();
    skin_->frame.pressure.origin = PressureOrigin::kConstant;
    pipeline_->Process(skin_->frame, state_);
  }
  Result<TareSummary> Tare(const TareOptions& options, double time_s, int most_waited = 0) {
    const auto begun = pipeline_->BeginTare(options);
    if (!begun) return begun.error();
    for (int k = 0; k < options.frames + most_waited; ++k) {
      Process(time_s + k * kTareFrameS);
      if (auto end = pipeline_->TakeTareEnd()) return *std::move(end);
    }
    return Error{ErrorCode::kInternal, "no end"};
  }
  double TotalForce() const { return state_.total_force_n.norm(); }

  FrameClock clock_;
  std::unique_ptr<MovingSkin> skin_;
  std::unique_ptr<LinkPipeline> pipeline_;
  LinkState state_;
  uint64_t sequence_ = 0;
};

TEST_F(TareTest, AFreeSkinIsTared) {
  Start(TouchScene());
  EXPECT_EQ(state_.baseline.origin, BaselineOrigin::kStart);
  const int64_t first_ns = state_.baseline.taken_utc_ns;
  EXPECT_GT(first_ns, 0);
  clock_.now_ns += 5'000'000'000;
  const auto tare = Tare({.frames = 6}, kFreeS);
  ASSERT_TRUE(tare.ok()) << tare.error().message;
  EXPECT_EQ(tare->frames, 6);
  EXPECT_FALSE(tare->forced);
  EXPECT_NEAR(tare->previous_age_s, 5.2, 0.2);
  EXPECT_LT(tare->shift_mm, 0.1) << "nothing has changed";
  Process(kFreeS);
  EXPECT_EQ(state_.baseline.origin, BaselineOrigin::kTare);
  EXPECT_GT(state_.baseline.taken_utc_ns, first_ns);
  EXPECT_NEAR(state_.baseline_age_s, kTareFrameS, 1e-6);
  EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
  EXPECT_TRUE(state_.contacts.empty());
  for (double t = 1.4; t < kTareTouchedS; t += kTareFrameS) Process(t);
  ASSERT_EQ(state_.contacts.size(), 1u);
  EXPECT_NEAR(TotalForce(), 0.2, 0.04);
}

// So that the same pictures solved later, by another clock, tell the same.
TEST_F(TareTest, TheBaselineHasTheTimesOfItsFrames) {
  Start(TouchScene());
  const int64_t rest_utc_ns = 1'600'000'000'000'000'000;
  pipeline_ = std::make_unique<LinkPipeline>(skin_->model, Options(), clock_);
  for (int k = 0; k < 6; ++k) {
    skin_->Take(0, sequence_++);
    skin_->frame.times.exposure_monotonic_ns = 1'000'000 * (k + 1);
    skin_->frame.times.exposure_utc_ns = rest_utc_ns + k;
    skin_->frame.pressure_mpa.reset();
    skin_->frame.pressure.origin = PressureOrigin::kConstant;
    pipeline_->Process(skin_->frame, state_);
  }
  EXPECT_EQ(state_.baseline.taken_utc_ns, rest_utc_ns + 3);
  EXPECT_DOUBLE_EQ(state_.baseline_age_s, 2e-3);
}

// Nor does it matter what the state's buffers were used for before.
TEST_F(TareTest, WhileRestIsTakenAnewTheStateHoldsNothingOld) {
  Start(TouchScene());
  for (double t = 1.4; t < kTareTouchedS; t += kTareFrameS) Process(t);
  ASSERT_TRUE(state_.measured());
  pipeline_->BeginRest(4);
  Process(0);
  EXPECT_EQ(state_.status, LinkStatus::kCalibrating);
  EXPECT_FALSE(state_.measured());
  EXPECT_TRUE(state_.contacts.empty());
  EXPECT_EQ(state_.baseline.origin, BaselineOrigin::kNone);
  EXPECT_EQ(state_.baseline_age_s, 0);
  for (const CameraCounts& camera : state_.cameras) EXPECT_EQ(camera.labelled, 0);
}

TEST_F(TareTest, ATouchedSkinIsRefusedUnlessForced) {
  Start(TouchScene());
  for (double t = 1.4; t < kTareTouchedS; t += kTareFrameS) Process(t);
  ASSERT_NEAR(TotalForce(), 0.2, 0.04);
  const auto refused = Tare({.frames = 6}, kTareTouchedS);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kFailedPrecondition);
  EXPECT_THAT(refused.error().message, HasSubstr("touched: a contact of 0."));
  Process(kTareTouchedS);
  EXPECT_EQ(state_.baseline.origin, BaselineOrigin::kStart);
  EXPECT_NEAR(TotalForce(), 0.2, 0.04) << "all is as it was";

  const auto forced = Tare({.frames = 6, .force = true}, kTareTouchedS);
  ASSERT_TRUE(forced.ok()) << forced.error().message;
  EXPECT_TRUE(forced->forced);
  EXPECT_GT(forced->shift_mm, 0.5);
  for (int k = 0; k < 10; ++k) Process(kTareTouchedS + k * kTareFrameS);
  EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
  EXPECT_EQ(state_.baseline.origin, BaselineOrigin::kForcedTare);
  EXPECT_LT(TotalForce(), 0.03) << "the touch is the baseline now";
  EXPECT_GT(state_.shape.seen(), 200);
  for (double t = 29.5; t < 32; t += kTareFrameS) Process(t);
  ASSERT_NE(state_.status, LinkStatus::kOk) << "the touch has gone, and what it did to the baseline shows";
  EXPECT_EQ(state_.reasons.back().id, ReasonId::kForcedBaseline) << state_.status_reason;
}

TEST_F(TareTest, ATareIsUndoneOnce) {
  Start(TouchScene());
  for (double t = 1.4; t < kTareTouchedS; t += kTareFrameS) Process(t);
  const double force_n = TotalForce();
  const Baseline before = state_.baseline;
  ASSERT_GT(force_n, 0.15);
  EXPECT_THAT(Tare({.undo = true}, kTareTouchedS).error().message, HasSubstr("no tare to undo"));
  const auto tare = Tare({.frames = 4, .force = true}, kTareTouchedS);
  ASSERT_TRUE(tare.ok()) << tare.error().message;
  Process(kTareTouchedS);
  EXPECT_LT(TotalForce(), 0.05);
  const auto undone = Tare({.frames = 1, .undo = true}, kTareTouchedS);
  ASSERT_TRUE(undone.ok()) << undone.error().message;
  EXPECT_TRUE(undone->undone);
  EXPECT_EQ(undone->shift_mm, tare->shift_mm);
  Process(kTareTouchedS);
  EXPECT_EQ(state_.baseline.origin, before.origin);
  EXPECT_EQ(state_.baseline.taken_utc_ns, before.taken_utc_ns);
  EXPECT_NEAR(TotalForce(), force_n, 0.02);
  EXPECT_FALSE(Tare({.undo = true}, kTareTouchedS).ok());
}

TEST_F(TareTest, AForcedBaselineStaysSoWhereATareSeesNothing) {
  Start(TouchScene());
  for (double t = 1.4; t < kTareTouchedS; t += kTareFrameS) Process(t);
  ASSERT_TRUE(Tare({.frames = 6, .force = true}, kTareTouchedS).ok());
  const auto again = Tare({.frames = 6}, kTareTouchedS);
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_FALSE(again->forced);
  Process(kTareTouchedS);
  EXPECT_EQ(state_.baseline.origin, BaselineOrigin::kForcedTare) << "what touched is still there";
  pipeline_->Restart();
  for (int k = 0; k <= Options().rest_frames; ++k) Process(0);
  EXPECT_EQ(state_.baseline.origin, BaselineOrigin::kStart);
}

// Two bodies whose mark is left in the baseline: no load explains the skin once they have gone.
TEST_F(TareTest, ATareEndsWhereNoLoadExplainsTheMarkers) {
  Scene scene = TouchScene();
  scene.contacts[0].force_n = 0.6;
  Start(scene);
  for (double t = 1.4; t < kTareTouchedS; t += kTareFrameS) Process(t);
  ASSERT_TRUE(Tare({.frames = 6, .force = true}, kTareTouchedS).ok());
  for (double t = 29.5; t < 32; t += kTareFrameS) Process(t);
  ASSERT_EQ(state_.reasons.front().id, ReasonId::kNotConverged) << state_.status_reason;
  const auto refused = Tare({.frames = 6}, 32, 100);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kFailedPrecondition);
  EXPECT_THAT(refused.error().message, HasSubstr("no answer to tare by"));
}

TEST_F(TareTest, AHiddenCameraKeepsItsBaseline) {
  Start(TouchScene());
  ASSERT_TRUE(pipeline_->BeginTare({.frames = 3, .force = true}).ok());
  std::optional<Result<TareSummary>> end;
  for (int k = 0; k < 3; ++k) {
    skin_->Take(kFreeS, sequence_++);
    skin_->frame.images[Index(CameraId::kBottom)].valid = false;
    pipeline_->Process(skin_->frame, state_);
    end = pipeline_->TakeTareEnd();
  }
  skin_->frame.images[Index(CameraId::kBottom)].valid = true;
  ASSERT_TRUE(end && *end) << (end ? end->error().message : "no end");
  EXPECT_TRUE((*end)->forced);
  for (double t = 1.4; t < kTareTouchedS; t += kTareFrameS) Process(t);
  EXPECT_NEAR(TotalForce(), 0.2, 0.04);
}

TEST_F(TareTest, NeedsABaselineAndOneAtATime) {
  skin_ = std::make_unique<MovingSkin>("cylinder", TouchScene());
  pipeline_ = std::make_unique<LinkPipeline>(skin_->model, Options(), clock_);
  EXPECT_FALSE(pipeline_->BeginTare({}).ok());
  for (int k = 0; k <= 4; ++k) Process(0);
  ASSERT_TRUE(pipeline_->BeginTare({}).ok());
  EXPECT_FALSE(pipeline_->BeginTare({}).ok());
  pipeline_->BeginRest(3);
  const auto end = pipeline_->TakeTareEnd();
  ASSERT_TRUE(end.has_value());
  EXPECT_THAT(end->error().message, HasSubstr("again"));
}

TEST_F(TareTest, CreepIsFollowedReportedAndTared) {
  // Pressure that nobody measures blows the skin up slowly: a creep of the whole skin. Rates are those of a
  // test that should not take hours.
  Scene scene = TouchScene();
  scene.contacts.clear();
  scene.pressure = {{0.5, 0}, {8, 0.5}};
  PipelineOptions options = Options();
  Start(scene, options);
  for (double t = 0; t < 10; t += kTareFrameS) Process(t);
  const auto largest = [&] {
    double most = 0;
    for (const Vec3& u : state_.shape.displacements_mm) most = std::max(most, u.norm());
    return most;
  };
  const double creep_mm = largest();
  ASSERT_GT(creep_mm, 0.15);
  EXPECT_EQ(state_.baseline.drift_state, DriftState::kOff);

  options.drift = {.time_constant_s = 0.3, .rate_limit_mm_s = 1, .limit_mm = 0.5 * creep_mm, .quiet_s = 0.3};
  Start(scene, options);
  for (double t = 0; t < 10; t += kTareFrameS) Process(t);
  EXPECT_LT(largest(), 0.3 * creep_mm);
  EXPECT_TRUE(state_.contacts.empty());
  EXPECT_NEAR(state_.baseline.drift_mm, creep_mm, 0.3 * creep_mm);
  EXPECT_EQ(state_.baseline.drift_state, DriftState::kFollowing);
  EXPECT_EQ(state_.status, LinkStatus::kDegraded);
  EXPECT_THAT(state_.status_reason, HasSubstr("tare the link"));
  ASSERT_EQ(state_.reasons.size(), 1u);
  EXPECT_EQ(state_.reasons[0].id, ReasonId::kDrift);
  EXPECT_NEAR(state_.reasons[0].value.value_or(0), creep_mm, 0.3 * creep_mm);
  EXPECT_EQ(state_.reasons[0].limit, 0.5 * creep_mm);

  const auto tare = Tare({.frames = 6}, 10);
  ASSERT_TRUE(tare.ok()) << tare.error().message;
  EXPECT_NEAR(tare->shift_mm, creep_mm, 0.3 * creep_mm) << "against the baseline as it was taken";
  Process(10);
  EXPECT_EQ(state_.status, LinkStatus::kOk) << state_.status_reason;
  EXPECT_EQ(state_.baseline.drift_mm, 0);
  EXPECT_LT(largest(), 0.1);
}

class TareCollectorTest : public ::testing::Test {
 protected:
  TareCollectorTest() {
    const auto count = static_cast<size_t>(model_.markers.count());
    state_.shape.positions_mm.resize(count);
    state_.status_reason = "why";
    off_mm_.assign(count, Vec3::Zero());
    for (size_t c = 0; c < kCameraCount; ++c) {
      labels_.cameras[c].assign(count, {.seen = true, .center_px = Vec2(100, 100)});
      state_.cameras[c].labelled = model_.markers.count();
    }
  }
  Result<bool> Take(TareCollector& tare, double off_mm, double kpa = 0) {
    off_mm_[5] = Vec3(0, off_mm, 0);
    return tare.Add(state_, labels_, off_mm_, {1e-3 * kpa, 2e-5});
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  LinkState state_;
  LabelledMarkers labels_;
  std::vector<Vec3> off_mm_;
};

TEST_F(TareCollectorTest, AMovingSkinIsRefusedUnlessForced) {
  for (const bool force : {false, true}) {
    TareCollector tare(model_, {.frames = 4, .force = force});
    for (int k = 0; k < 3; ++k) ASSERT_FALSE(Take(tare, 0.2 * k).value());
    const auto end = Take(tare, 0.6);
    ASSERT_EQ(end.ok(), force);
    EXPECT_EQ(tare.forced(), force);
    if (force) {
      EXPECT_NEAR(tare.shift_mm(), 0.3, 1e-9);
    } else {
      EXPECT_THAT(end.error().message, HasSubstr("moved by 0.40 mm"));
    }
  }
}

TEST_F(TareCollectorTest, APressureThatChangesIsRefusedUnlessForced) {
  for (const bool force : {false, true}) {
    TareCollector tare(model_, {.frames = 4, .force = force});
    for (int k = 0; k < 3; ++k) ASSERT_FALSE(Take(tare, 0, 0.5 + 0.1 * k).value());
    const auto end = Take(tare, 0, 0.8);
    ASSERT_EQ(end.ok(), force);
    EXPECT_EQ(tare.forced(), force);
    if (!force) {
      EXPECT_THAT(end.error().message, HasSubstr("changed from 0.500 to 0.800 kPa"));
    }
    EXPECT_NEAR(tare.loads().pressure_mpa, 0.65e-3, 1e-11);
  }
  // What a sensor scatters is no change; the markers' mean belongs to the readings' mean.
  TareCollector tare(model_, {.frames = 4});
  for (const double kpa : {0.52, 0.48, 0.51}) ASSERT_FALSE(Take(tare, 0, kpa).value());
  ASSERT_TRUE(Take(tare, 0, 0.47).value());
  EXPECT_NEAR(tare.loads().pressure_mpa, 0.495e-3, 1e-11);
}

TEST_F(TareCollectorTest, FewMarkersAreRefusedUnlessForced) {
  state_.cameras[1].labelled = 10;
  TareCollector careful(model_, {.frames = 2}), forced(model_, {.frames = 2, .force = true});
  EXPECT_THAT(Take(careful, 0).error().message, HasSubstr("bottom camera sees only 10 of 240"));
  ASSERT_TRUE(Take(forced, 0).ok());
  EXPECT_TRUE(forced.forced());
}

TEST_F(TareCollectorTest, WithoutAMeasurementNoForceHelps) {
  state_.shape.positions_mm.clear();
  TareCollector tare(model_, {.frames = 2, .force = true});
  EXPECT_THAT(Take(tare, 0).error().message, HasSubstr("nothing is measured: why"));
}

TEST_F(TareCollectorTest, AForceThatWasNotNeededIsNotReported) {
  TareCollector tare(model_, {.frames = 2, .force = true});
  ASSERT_FALSE(Take(tare, 0.01).value());
  ASSERT_TRUE(Take(tare, 0.01).value());
  EXPECT_FALSE(tare.forced());
}

// A cuff that presses alike all around: its resultant is about zero.
TEST_F(TareCollectorTest, ARingContactIsATouch) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  const auto count = static_cast<size_t>(model.markers.count());
  LinkState state;
  state.status = LinkStatus::kOk;
  state.shape.positions_mm.assign(count, Vec3(30, 0, 50));
  for (CameraCounts& camera : state.cameras) camera.labelled = model.markers.count();
  LabelledMarkers labels;
  for (auto& camera : labels.cameras) camera.resize(count);
  const std::vector<Vec3> off_mm(count, Vec3::Zero());
  const auto add = [&] { return TareCollector(model, {.frames = 2}).Add(state, labels, off_mm, {}); };
  ASSERT_TRUE(add().ok());
  Contact& ring = state.contacts.emplace_back();
  ring.is_ring_contact = true;
  ring.normal_force_n = 0.5;
  const auto refused = add();
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, HasSubstr("touched: a contact of 0.50 N"));
}

}  // namespace
}  // namespace taclink
