// A held contact while a regulator inflates and vents the skin: what the frames know of the pressure are the
// readings of the regulator's noisy sensor, and what the skin has is the pressure behind its valve.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "sensing/model/model_file.h"
#include "sensing/pipeline/link_pipeline.h"
#include "sensing/simulation/simulated_source.h"
#include "server/pressure/pressure_controller.h"
#include "server/simulation/simulation_desk.h"
#include "tests/server/support.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;

constexpr double kRateHz = 20;
constexpr int kRestFrames = 8;
constexpr double kDepthMm = 1, kPeakKpa = 1.5;
constexpr double kRelative = 0.1, kAbsoluteN = 0.03;  // of the true force, whichever is larger

Scene UntouchedScene() {
  Scene scene = LoadScene("rest").value();
  scene.frame_rate_hz = kRateHz;
  scene.duration_s = 60;
  scene.camera.marker_jitter_px = 0.1;
  return scene;
}

class InflationTest : public ::testing::Test {
 protected:
  InflationTest() {
    clock_.LetSleepingPassTime();
    PipelineOptions options;
    options.rest_frames = kRestFrames;
    options.drift = DriftOptions{};
    pipeline_ = std::make_unique<LinkPipeline>(model_, options, clock_);
    source_ = SimulatedSource::Make(model_, scene_, clock_, ScenePace::kClock, [this] {
                return desk_.Now();
              }).value();
    EXPECT_TRUE(source_->Start().ok());
  }

  /// The control loop runs up to the next exposure; then a frame is taken and solved.
  void NextFrame() {
    exposure_ns_ += std::llround(1e9 / kRateHz);
    while (clock_.MonotonicNs() < exposure_ns_) controller_.Step(milliseconds(10));
    ASSERT_TRUE(source_->Next(frame_, milliseconds(100)).ok());
    ASSERT_EQ(frame_.times.exposure_monotonic_ns, exposure_ns_);
    true_kpa_ = 1e3 * frame_.pressure_mpa.value();
    controller_.Apply(frame_);
    pipeline_->Process(frame_, state_);
  }
  void Run(double span_s) {
    for (int i = 0; i < span_s * kRateHz; ++i) NextFrame();
  }
  /// Newtons: of all contacts found, and of the finger.
  double Found() const {
    Vec3 sum = Vec3::Zero();
    for (const Contact& contact : state_.contacts) sum += contact.force_n;
    return sum.norm();
  }
  double True() const {
    return frame_.simulation->contacts.empty() ? 0 : frame_.simulation->contacts[0].force_n.norm();
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  const Scene scene_ = UntouchedScene();
  ManualClock clock_;
  const SimulatedRegulatorOptions simulated_ = {
      .time_constant_s = 0.2, .slew_kpa_per_s = 1, .leak_per_s = 0.01, .noise_pa = 10, .offset_pa = 0};
  const std::shared_ptr<SimulatedRegulator> regulator_ =
      std::make_shared<SimulatedRegulator>(simulated_, 5, clock_);
  PressureController controller_{"skin", MakeSimulatedActuator(regulator_), RegulatorOptions{},
                                 milliseconds(1000), clock_};
  SimulationDesk desk_{model_, scene_, clock_, regulator_};
  std::unique_ptr<SimulatedSource> source_;
  std::unique_ptr<LinkPipeline> pipeline_;
  int64_t exposure_ns_ = clock_.MonotonicNs() - std::llround(1e9 / kRateHz);
  StereoFrame frame_;
  LinkState state_;
  double true_kpa_ = 0;
};

// The finger is held by its depth, as an arm holds it: a slack skin snaps through under a force of 0.5 N. It
// presses harder the more the skin is inflated, up to some 0.5 N.
TEST_F(InflationTest, AHeldContactIsMeasuredWhileThePressureRampsUpAndDown) {
  Run(0.8);
  ASSERT_TRUE(state_.measured()) << state_.status_reason;
  ASSERT_TRUE(desk_
                  .Press({.id = 1,
                          .shape = BodyShape::kFinger,
                          .at = {.angle_rad = 0.4, .z_mm = 100},
                          .depth_mm = kDepthMm,
                          .force_n = std::nullopt},
                         0)
                  .ok());
  Run(0.6);
  int frames = 0, good = 0;
  double worst_n = 0, worst_pressure_pa = 0, highest_kpa = 0, highest_n = 0;
  const auto judge = [&](double span_s) {
    for (int i = 0; i < span_s * kRateHz; ++i) {
      NextFrame();
      const double error_n = std::abs(Found() - True());
      good += state_.measured() && error_n <= std::max(kAbsoluteN, kRelative * True());
      ++frames;
      worst_n = std::max(worst_n, error_n);
      worst_pressure_pa = std::max(worst_pressure_pa, 1e3 * std::abs(1e3 * frame_.pressure.mpa - true_kpa_));
      highest_kpa = std::max(highest_kpa, true_kpa_);
      highest_n = std::max(highest_n, True());
    }
  };
  ASSERT_TRUE(controller_.Set({.kpa = kPeakKpa}).ok());
  judge(kPeakKpa / 0.5 + 1);
  EXPECT_EQ(controller_.Status().state, RegulatorState::kHolding);
  ASSERT_TRUE(controller_.Set({.kpa = 0}).ok());
  judge(kPeakKpa / 0.5 + 1);
  std::printf(
      "%d of %d frames good; force to %.3f N, worst error %.3f N; pressure to %.3f kPa, read within %.1f "
      "Pa\n",
      good, frames, highest_n, worst_n, highest_kpa, worst_pressure_pa);
  EXPECT_GT(highest_kpa, 1.49) << "the skin was inflated";
  EXPECT_LT(true_kpa_, 0.01) << "and is slack again";
  EXPECT_GT(highest_n, 0.4);
  EXPECT_LT(worst_pressure_pa, 80) << "the skin follows the regulator: noise of 10 Pa, 20 ms at 0.5 kPa/s";
  EXPECT_GE(good, std::ceil(0.98 * frames));
}

}  // namespace
}  // namespace taclink::server
