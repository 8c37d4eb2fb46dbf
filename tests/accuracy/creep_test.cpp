// A skin that creeps by 8 % in a minute, from images of it through the whole pipeline, for minutes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "sensing/model/model_file.h"
#include "sensing/pipeline/link_pipeline.h"
#include "sensing/simulation/renderer.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink {
namespace {

constexpr double kForceN = 0.5, kGhostN = 0.02, kForceShare = 0.05;
constexpr int kRestPairs = 8;
constexpr double kRestKpa = 0.3;  // the more, the more of a dent is held by pressure, which does not creep
constexpr double kPressS = 5, kReleaseS = 605;  // and half a second for each

// J(60 s) / J(0): of springs with dashpots in a row, beside a spring, under a constant force, by forward
// differences of the dashpots' strains.
double ComplianceAfterAMinute(const std::vector<RelaxationTerm>& terms) {
  constexpr double kStepS = 1e-3;
  double strain = 1;
  std::vector<double> internal(terms.size(), 0);  // of each dashpot
  for (double t = 0; t < 60; t += kStepS) {
    for (size_t i = 0; i < terms.size(); ++i)
      internal[i] += kStepS * (strain - internal[i]) / terms[i].time_s;
    strain = 1;
    for (size_t i = 0; i < terms.size(); ++i) strain += terms[i].share * internal[i];
  }
  return strain;
}

LinkModel ElasticModel() {
  return LoadLinkModel("cylinder").value();
}

LinkModel CreepingModel() {
  LinkModel model = ElasticModel();
  double least = 0.5, most = 1.5;
  while (most - least > 1e-6) {
    const double scale = (least + most) / 2;
    model.relaxation.terms = {{0.04 * scale, 5}, {0.05 * scale, 40}};
    (ComplianceAfterAMinute(model.relaxation.terms) < 1.08 ? least : most) = scale;
  }
  return model;
}

SceneContact Press(double begin_s, double end_s) {
  SceneContact contact;
  contact.at.path = 7;
  contact.at.ring = 8;
  contact.patch_diameter_mm = 12;
  contact.force_n = kForceN;
  contact.begin_s = begin_s;
  contact.end_s = end_s;
  contact.ramp_s = 0.5;
  return contact;
}

Scene MinutesOf(std::vector<PressureKey> pressure, std::vector<SceneContact> contacts, double duration_s) {
  Scene scene;
  scene.name = "creep";
  scene.model = "cylinder";
  scene.loop = false;
  scene.duration_s = duration_s;
  scene.pressure = std::move(pressure);
  scene.contacts = std::move(contacts);
  return scene;
}

double StrongestN(const LinkState& state) {
  double strongest = 0;
  for (const Contact& contact : state.contacts) strongest = std::max(strongest, contact.magnitude_n());
  return strongest;
}

/// A simulated link whose images several pipelines see: one that knows how the skin creeps, one that does
/// not.
class CreepTest : public ::testing::Test {
 protected:
  void Play(const Scene& scene) {
    auto skin = SimulatedSkin::Make(creeping_, scene);
    ASSERT_TRUE(skin.ok()) << skin.error().message;
    skin_ = std::move(*skin);
    std::printf("%s\n", skin_->Preparation().c_str());
    PipelineOptions options;
    options.rig = creeping_.nominal_rig;  // cameras are not calibrated under pressure
    options.rest_frames = kRestPairs;
    options.drift = DriftOptions{};
    knowing_.emplace(creeping_, options);
    elastic_.emplace(ElasticModel(), options);
    for (int k = 0; k < kRestPairs; ++k) See(0.1 * k);
    ASSERT_TRUE(knowing_->calibration().has_value()) << state_.status_reason;
  }

  void See(double time_s) {
    skin_->Evaluate(time_s, truth_);
    truth_.frame = frame_.sequence + 1;  // a noise of its own
    for (const CameraId id : kBothCameras) {
      renderer_.Render(truth_, id, gray_);
      PackYuyv(gray_, renderer_.chroma(id), frame_.images[Index(id)]);
    }
    ++frame_.sequence;
    frame_.times.exposure_monotonic_ns = static_cast<int64_t>(1e9 * (time_s + 100));
    frame_.pressure = {.origin = PressureOrigin::kSimulated, .mpa = truth_.pressure_mpa, .age_ns = 0};
    frame_.pressure_mpa = truth_.pressure_mpa;
    knowing_->Process(frame_, state_);
    elastic_->Process(frame_, without_);
  }

  // Two images a second for 20 s, then one every ten seconds.
  template <typename Check>
  void Follow(double begin_s, double end_s, Check check) {
    for (double t = begin_s; t < end_s; t += t - begin_s < 20 ? 0.5 : 10) {
      See(t);
      check(t);
      if (HasFatalFailure()) return;
    }
  }

  const LinkModel creeping_ = CreepingModel();
  std::unique_ptr<SimulatedSkin> skin_;
  Renderer renderer_{creeping_, creeping_.nominal_rig, CameraEffects{}, 3};
  std::optional<LinkPipeline> knowing_, elastic_;
  StereoFrame frame_;
  cv::Mat gray_;
  SkinTruth truth_;
  LinkState state_, without_;
};

TEST_F(CreepTest, AForceThatIsHeldReadsTheSameAndLeavesNothingBehind) {
  Play(MinutesOf({{0, kRestKpa}}, {Press(kPressS, kReleaseS + 0.5)}, 950));
  double least = 1e9, most = 0, most_without = 0, ghost = 0, ghost_without = 0;
  Follow(kPressS + 0.5, kReleaseS, [&](double t) {
    ASSERT_EQ(state_.contacts.size(), 1u) << t << ": " << state_.status_reason;
    least = std::min(least, StrongestN(state_));
    most = std::max(most, StrongestN(state_));
    most_without = std::max(most_without, StrongestN(without_));
  });
  Follow(kReleaseS + 0.5, 940, [&](double t) {
    ASSERT_TRUE(state_.has_forces()) << t << ": " << state_.status_reason;
    // The dent that recovers is not learned as drift.
    if (t < kReleaseS + 60) {
      EXPECT_EQ(state_.baseline.drift_state, DriftState::kHeld) << t;
    }
    EXPECT_LT(state_.baseline.drift_mm, 0.02) << t;
    ghost = std::max(ghost, StrongestN(state_));
    ghost_without = std::max(ghost_without, StrongestN(without_));
  });
  std::printf(
      "0.5 N held for 600 s reads %.4f to %.4f N, without the model's relaxation up to %.4f N; after it %.4f "
      "and %.4f N\n",
      least, most, most_without, ghost, ghost_without);
  EXPECT_GT(least, (1 - kForceShare) * kForceN);
  EXPECT_LT(most, (1 + kForceShare) * kForceN);
  EXPECT_LT(ghost, kGhostN);
  EXPECT_GT(most_without, (1 + kForceShare) * kForceN);
  EXPECT_GT(ghost_without, kGhostN);
}

// A press soon after the tare, while a twelfth of the first one's dent is in the baseline's images, one when
// that has recovered, and nothing between them.
TEST_F(CreepTest, ATareRightAfterALoadIsRight) {
  constexpr double kSoonS = kReleaseS + 5, kAgainS = 1230;
  Play(MinutesOf({{0, kRestKpa}},
                 {Press(kPressS, kReleaseS + 0.5), Press(kSoonS, kSoonS + 10), Press(kAgainS, kAgainS + 60)},
                 1290));
  Follow(kPressS, kReleaseS, [](double) {});
  See(kReleaseS + 0.5);
  ASSERT_TRUE(knowing_->BeginTare({.frames = 5}).ok());
  for (int k = 1; k <= 5; ++k) See(kReleaseS + 0.5 + 0.1 * k);
  const auto tare = knowing_->TakeTareEnd();
  ASSERT_TRUE(tare.has_value());
  ASSERT_TRUE(tare->ok()) << tare->error().message;
  double ghost = 0, least = 1e9, most = 0;
  const auto untouched = [&](double t) {
    ASSERT_TRUE(state_.has_forces()) << t << ": " << state_.status_reason;
    ghost = std::max(ghost, StrongestN(state_));
  };
  const auto pressed = [&](double t) {
    ASSERT_EQ(state_.contacts.size(), 1u) << t << ": " << state_.status_reason;
    least = std::min(least, StrongestN(state_));
    most = std::max(most, StrongestN(state_));
  };
  Follow(kReleaseS + 1.5, kSoonS, untouched);
  Follow(kSoonS + 0.5, kSoonS + 9.5, pressed);
  std::printf("after a tare up to %.4f N, then 0.5 N reads %.4f to %.4f N", ghost, least, most);
  Follow(kSoonS + 10, kAgainS, untouched);
  Follow(kAgainS + 0.5, kAgainS + 59, pressed);
  std::printf(", then up to %.4f N, then 0.5 N from %.4f to %.4f N\n", ghost, least, most);
  EXPECT_LT(ghost, kGhostN);
  EXPECT_GT(least, (1 - kForceShare) * kForceN);
  EXPECT_LT(most, (1 + kForceShare) * kForceN);
}

TEST_F(CreepTest, APressureThatIsHeldIsNoContact) {
  Play(MinutesOf({{0, 0}, {kPressS, 0}, {kPressS + 1, 1}}, {}, 620));
  double ghost = 0;
  int worse = 0, worse_without = 0;
  Follow(kPressS + 1, 610, [&](double t) {
    ASSERT_TRUE(state_.has_forces()) << t << ": " << state_.status_reason;
    ghost = std::max(ghost, StrongestN(state_));
    EXPECT_NEAR(state_.pressure_estimate.value_or(PressureEstimate{}).mpa, 1e-3, 2e-5) << t;
    worse += state_.status == LinkStatus::kOk ? 0 : 1;
    worse_without += without_.status == LinkStatus::kOk ? 0 : 1;
  });
  std::printf("1 kPa held for 600 s: up to %.4f N, %d frames worse than ok, without relaxation %d\n", ghost,
              worse, worse_without);
  EXPECT_LT(ghost, kGhostN);
  EXPECT_EQ(worse, 0);
  EXPECT_GT(worse_without, 0);
}

}  // namespace
}  // namespace taclink
