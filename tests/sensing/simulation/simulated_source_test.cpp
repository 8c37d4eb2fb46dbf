#include "sensing/simulation/simulated_source.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "sensing/capture/decode.h"
#include "tests/sensing/simulation/scene_text.h"
#include "tests/support/times.h"

namespace taclink {
namespace {

using std::chrono::milliseconds;

class FakeClock final : public Clock {
 public:
  int64_t MonotonicNs() const override { return now_ns; }
  int64_t UtcNs() const override { return now_ns + 1'000'000'000'000; }
  void SleepUntilMonotonicNs(int64_t time_ns) override { now_ns = std::max(now_ns, time_ns); }

  int64_t now_ns = 5000 * kMs;
};

class SimulatedSourceTest : public ::testing::Test {
 protected:
  std::unique_ptr<SimulatedSource> Source(const std::string& more) {
    auto source = SimulatedSource::Make(Model("cylinder"), SceneWith("frame_rate_hz: 100\n" + more), clock_);
    EXPECT_TRUE(source.ok());
    return std::move(*source);
  }
  FakeClock clock_;
  StereoFrame frame_;
};

TEST_F(SimulatedSourceTest, DeliversAtTheScenesRate) {
  const auto source = Source("pressure_kpa: 0.5\n");
  EXPECT_EQ(source->Next(frame_, milliseconds(20)).error().code, ErrorCode::kUnavailable);
  ASSERT_TRUE(source->Start().ok());
  EXPECT_EQ(source->Info().frame_rate_hz, 100);
  EXPECT_EQ(source->Info().width_px, 640);
  const int64_t start = clock_.now_ns;
  for (int k = 0; k < 5; ++k) {
    ASSERT_TRUE(source->Next(frame_, milliseconds(20)).ok());
    EXPECT_EQ(frame_.sequence, static_cast<uint64_t>(k));
    EXPECT_EQ(clock_.now_ns, start + int64_t{k} * 10 * kMs);
    EXPECT_EQ(frame_.times.exposure_monotonic_ns, clock_.now_ns);
    EXPECT_EQ(frame_.times.exposure_utc_ns, clock_.UtcNs());
    EXPECT_EQ(frame_.times.received_ns, clock_.now_ns);
    EXPECT_EQ(source->truth().frame, frame_.sequence);
    EXPECT_DOUBLE_EQ(frame_.pressure_mpa.value_or(0), 0.5e-3);
    for (const RawImage& image : frame_.images) {
      EXPECT_TRUE(image.valid);
      EXPECT_EQ(image.format, PixelFormat::kYuyv);
      EXPECT_EQ(image.bytes.size(), 640U * 480 * 2);
    }
  }
}

TEST_F(SimulatedSourceTest, GivesTheSpecificForceOfAMovingLink) {
  const std::string header = "taclink_scene: 1\nname: s\nduration_s: 4\nrefinement: 1\n";
  for (const bool moves : {true, false}) {
    const Scene scene =
        ParseScene("s.yaml", header + (moves ? "motion: {gravity_mps2: [0, -9.81, 0]}\n" : "")).value();
    auto source = SimulatedSource::Make(Model("cylinder"), scene, clock_);
    ASSERT_TRUE(source.ok()) << source.error().message;
    ASSERT_TRUE((*source)->Start().ok());
    frame_.specific_force = SpecificForceReading{};  // of a frame before
    ASSERT_TRUE((*source)->Next(frame_, milliseconds(20)).ok());
    ASSERT_EQ(frame_.specific_force.has_value(), moves);
    EXPECT_FALSE(frame_.joint);
    if (!moves) continue;
    EXPECT_EQ(frame_.specific_force->mps2, Vec3(0, -9.81, 0));
    EXPECT_EQ(frame_.specific_force->origin, AttitudeOrigin::kSimulated);
    EXPECT_GT(frame_.specific_force->covariance.trace(), 0);
  }
}

TEST_F(SimulatedSourceTest, AJointFollowsTheSwingLoopByLoop) {
  const Scene scene =
      ParseScene("s.yaml",
                 "taclink_scene: 1\nname: s\nduration_s: 4\nrefinement: 1\nframe_rate_hz: 10\n"
                 "motion: {swing: {amplitude_deg: 30, period_s: 4, joint: shoulder}}\n")
          .value();
  auto source = SimulatedSource::Make(Model("cylinder"), scene, clock_);
  ASSERT_TRUE(source.ok()) << source.error().message;
  ASSERT_TRUE((*source)->Start().ok());
  for (int i = 0; i <= 50; ++i) ASSERT_TRUE((*source)->Next(frame_, milliseconds(200)).ok());
  ASSERT_TRUE(frame_.joint);  // 1 s into the second loop
  EXPECT_EQ(frame_.joint->name, "shoulder");
  EXPECT_NEAR(frame_.joint->position_rad, 0, 1e-9);
  EXPECT_NEAR(frame_.joint->velocity_radps, RadFromDeg(30) * 2 * kPi / 4, 1e-9);
}

TEST_F(SimulatedSourceTest, SkipsToTheNewestWhenLate) {
  const auto source = Source("");
  ASSERT_TRUE(source->Start().ok());
  ASSERT_TRUE(source->Next(frame_, milliseconds(20)).ok());
  clock_.now_ns += 57 * kMs;
  ASSERT_TRUE(source->Next(frame_, milliseconds(20)).ok());
  EXPECT_EQ(frame_.sequence, 5U);
  EXPECT_EQ(frame_.times.received_ns - frame_.times.exposure_monotonic_ns, 7 * kMs);
  ASSERT_TRUE(source->Next(frame_, milliseconds(20)).ok());
  EXPECT_EQ(frame_.sequence, 6U);
  clock_.now_ns += 3'600'000 * kMs;
  ASSERT_TRUE(source->Next(frame_, milliseconds(20)).ok());
  EXPECT_EQ(frame_.sequence, 360'006U);
}

TEST_F(SimulatedSourceTest, PacedByFramesSkipsNothing) {
  auto made =
      SimulatedSource::Make(Model("cylinder"), SceneWith("frame_rate_hz: 100\n"), clock_, ScenePace::kFrames);
  ASSERT_TRUE(made.ok());
  const auto source = std::move(*made);
  EXPECT_TRUE(source->WaitsForReader());
  ASSERT_TRUE(source->Start().ok());
  int64_t last_ns = 0;
  for (uint64_t k = 0; k < 6; ++k) {
    clock_.now_ns += (k % 2 == 0 ? 2 : 3000) * kMs;  // within the period, and far behind it
    ASSERT_TRUE(source->Next(frame_, milliseconds(20)).ok());
    EXPECT_EQ(frame_.sequence, k);
    EXPECT_EQ(source->truth().frame, k);
    EXPECT_GE(frame_.times.exposure_monotonic_ns, last_ns + (k == 0 ? 0 : 10 * kMs))
        << "at most at the scene's rate";
    EXPECT_LT(clock_.now_ns - frame_.times.exposure_monotonic_ns, 10 * kMs) << "exposed just now";
    last_ns = frame_.times.exposure_monotonic_ns;
  }
}

// However slow the machine, a scene that is paced by frames is not late by what its images took to make.
TEST_F(SimulatedSourceTest, PacedByFramesTheTimeOfRenderingIsNoAge) {
  for (const ScenePace pace : {ScenePace::kFrames, ScenePace::kClock}) {
    auto source =
        SimulatedSource::Make(Model("cylinder"), SceneWith("frame_rate_hz: 100\n"), clock_, pace, [this] {
          clock_.now_ns += 700 * kMs;
          return Handling();
        });
    ASSERT_TRUE(source.ok());
    ASSERT_TRUE((*source)->Start().ok());
    for (int i = 0; i < 3; ++i) {
      ASSERT_TRUE((*source)->Next(frame_, milliseconds(20)).ok());
      const int64_t age_ns = clock_.now_ns - frame_.times.exposure_monotonic_ns;
      EXPECT_EQ(frame_.times.exposure_utc_ns - frame_.times.exposure_monotonic_ns, 1'000'000'000'000);
      if (pace == ScenePace::kFrames) {
        EXPECT_LT(age_ns, 10 * kMs);
      } else {
        EXPECT_GE(age_ns, 700 * kMs);
        EXPECT_LT(age_ns, 710 * kMs) << "the newest";
      }
    }
  }
}

TEST_F(SimulatedSourceTest, TimesOutAndComesBack) {
  const auto source = Source("");
  ASSERT_TRUE(source->Start().ok());
  ASSERT_TRUE(source->Next(frame_, milliseconds(20)).ok());
  const int64_t before = clock_.now_ns;
  EXPECT_EQ(source->Next(frame_, milliseconds(4)).error().code, ErrorCode::kTimeout);
  EXPECT_EQ(clock_.now_ns, before + 4 * kMs);
  ASSERT_TRUE(source->Next(frame_, milliseconds(6)).ok());
  EXPECT_EQ(frame_.sequence, 1U);
}

TEST_F(SimulatedSourceTest, ExposureAndGainBrightenOneCamera) {
  const auto source = Source("camera: {sensor_noise_levels: 0, exposure: 0.3}\n");
  const auto mean = [&](CameraId id) {
    StereoFrame frame;
    EXPECT_TRUE(source->Start().ok());
    EXPECT_TRUE(source->Next(frame, milliseconds(20)).ok());
    cv::Mat gray;
    EXPECT_TRUE(GrayDecoder().Decode(frame.images[Index(id)], gray).ok());
    return cv::mean(gray)[0];
  };
  const double top = mean(CameraId::kTop), bottom = mean(CameraId::kBottom);
  ASSERT_TRUE(source->SetCamera(CameraId::kTop, {.exposure_100us = 100}).ok());
  EXPECT_NEAR(mean(CameraId::kTop), 2 * top, 0.1);
  EXPECT_EQ(mean(CameraId::kBottom), bottom);
  ASSERT_TRUE(source->SetCamera(CameraId::kTop, {.gain = 2}).ok()) << "and the exposure stays";
  EXPECT_GT(mean(CameraId::kTop), 3 * top);
  EXPECT_EQ(source->SetCamera(CameraId::kTop, {.gain = 0}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(source->SetCamera(CameraId::kTop, {.exposure_100us = 5000}).error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(source->SetCamera(CameraId::kTop, {.automatic_exposure = true}).error().code,
            ErrorCode::kUnsupported);
}

TEST_F(SimulatedSourceTest, EndsWhereTheSceneDoes) {
  const auto source = Source("loop: false\n");
  ASSERT_TRUE(source->Start().ok());
  clock_.now_ns += 3999 * kMs;
  ASSERT_TRUE(source->Next(frame_, milliseconds(20)).ok());
  EXPECT_EQ(frame_.sequence, 399U);
  ASSERT_TRUE(source->Next(frame_, milliseconds(20)).ok());
  EXPECT_EQ(source->Next(frame_, milliseconds(20)).error().code, ErrorCode::kEndOfData);
  ASSERT_TRUE(source->Start().ok());
  EXPECT_TRUE(source->Next(frame_, milliseconds(20)).ok());
}

TEST_F(SimulatedSourceTest, ReusesTheFramesBuffers) {
  Scene scene = LoadScene("stroke").value();
  scene.skin = SkinKind::kLinear;
  const auto source = MakeSimulatedSource(Model("cylinder"), scene, clock_, ScenePace::kClock);
  ASSERT_TRUE(source.ok());
  ASSERT_TRUE((*source)->Start().ok());
  ASSERT_TRUE((*source)->Next(frame_, milliseconds(50)).ok());
  const uint8_t* buffer = frame_.images[0].bytes.data();
  for (int k = 0; k < 60; ++k) ASSERT_TRUE((*source)->Next(frame_, milliseconds(50)).ok());
  EXPECT_EQ(frame_.images[0].bytes.data(), buffer);
}

}  // namespace
}  // namespace taclink
