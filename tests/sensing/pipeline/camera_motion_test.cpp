#include "sensing/pipeline/camera_motion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "sensing/model/model_file.h"
#include "tests/support/synthetic_markers.h"

namespace taclink {
namespace {

// Markers where two cameras see them, each of the skin as it was at a time of its own.
class CameraMotionTest : public ::testing::Test {
 protected:
  std::optional<CameraId> After(double time_s, const Motion& top, const Motion& bottom) {
    FrameTimes times;
    times.exposure_monotonic_ns = static_cast<int64_t>(1e9 * (1 + time_s));
    motion_->Observe(times, LabelsOf(model_, top, bottom, kNoisePx, random_));
    const auto disagreement = motion_->disagreement();
    return disagreement ? std::optional(disagreement->camera) : std::nullopt;
  }
  std::optional<CameraId> After(double time_s, const Motion& both) { return After(time_s, both, both); }

  Motion Dented(double depth_mm) const {
    return [=, this](const Vec3& rest) {
      return Deform(model_, {{.angle_rad = 1, .z_mm = 90, .depth_mm = depth_mm, .width_mm = 15}}, rest);
    };
  }

  static constexpr double kNoisePx = 0.07;
  const LinkModel model_ = LoadLinkModel("cylinder").value();
  std::optional<CameraMotion> motion_{std::in_place, model_, model_.nominal_rig, kNoisePx};
  std::mt19937 random_{1};
};

TEST_F(CameraMotionTest, APressIsSeenByBoth) {
  for (int frame = 0; frame < 60; ++frame) {
    const double depth_mm = 8 * std::abs(std::sin(frame / 10.0));
    EXPECT_EQ(After(frame / 30.0, Dented(depth_mm)), std::nullopt) << "frame " << frame;
  }
}

TEST_F(CameraMotionTest, ASkinAtRestIsSeenByNone) {
  for (int frame = 0; frame < 300; ++frame) EXPECT_EQ(After(frame / 30.0, Dented(4)), std::nullopt);
}

TEST_F(CameraMotionTest, ADragIsSeenByBoth) {
  double begin_s = 0;
  for (const double z_mm : {30.0, 60.0, 90.0, 140.0, 170.0}) {
    for (const Vec3& toward : {Vec3(0, 0, 1), Vec3(0, 0, -1), Vec3(-0.84, 0.54, 0), Vec3(-0.4, -0.6, 0.7)}) {
      begin_s += 10;
      for (int frame = 0; frame < 10; ++frame)
        EXPECT_EQ(After(begin_s + frame / 30.0, Dragged(model_, 0.4 * frame * toward, z_mm)), std::nullopt)
            << toward.transpose() << " at " << z_mm << " frame " << frame;
    }
  }
}

TEST_F(CameraMotionTest, ATouchBetweenTwoExposuresIsForgottenInTheNextFrame) {
  for (const double speed_mm_s : {10.0, 20.0, 50.0, 200.0}) {
    const double begin_s = 20 * speed_mm_s;
    const auto depth_mm = [&](double time_s) { return std::clamp(speed_mm_s * (time_s - 0.3), 0.0, 8.0); };
    int told = 0;
    for (int frame = 0; frame < 30; ++frame) {
      const double time_s = frame / 30.0;
      const auto alone = After(begin_s + time_s, Dented(depth_mm(time_s)), Dented(depth_mm(time_s - 0.016)));
      told += alone ? 1 : 0;
    }
    EXPECT_LE(told, 1) << speed_mm_s;
  }
}

// From the first frame in which the skin has moved by some tenths of a millimeter until both move together.
TEST_F(CameraMotionTest, APictureThatLagsIsTold) {
  const auto depth_mm = [](double time_s) { return 8 * std::clamp(time_s / 0.4, 0.0, 1.0); };
  for (int frame = 0; frame < 21; ++frame) {
    const double time_s = frame / 30.0;
    const auto alone = After(time_s, Dented(depth_mm(time_s - 0.2)), Dented(depth_mm(time_s)));
    EXPECT_EQ(alone.has_value(), frame > 0) << time_s;
  }
  ASSERT_TRUE(motion_->disagreement().has_value());
  EXPECT_EQ(motion_->disagreement()->camera, CameraId::kTop);
  EXPECT_NEAR(motion_->disagreement()->late_s, 0.2, 0.001);
  for (int frame = 21; frame < 200; ++frame)
    EXPECT_NE(After(frame / 30.0, Dented(8)), std::nullopt) << "nothing says that it is in time again";
  for (int frame = 200; frame < 220; ++frame) After(frame / 30.0, Dented(8 - 0.4 * (frame - 199)));
  EXPECT_FALSE(motion_->disagreement().has_value());
}

TEST_F(CameraMotionTest, ALagIsToldWhateverTheMotion) {
  for (const double lag_s : {0.1, 0.2, 0.5}) {
    for (const double ramp_s : {0.3, 0.8, 1.5}) {
      if (lag_s < 0.1 * ramp_s) continue;  // less than a millimeter
      motion_.emplace(model_, model_.nominal_rig, kNoisePx);
      const auto depth_mm = [&](double time_s) {
        return 3.5 * (1 - std::cos(kPi * std::clamp(time_s / ramp_s, 0.0, 1.0)));
      };
      for (int frame = 0; frame < 75; ++frame) {
        const double time_s = frame / 30.0, top_mm = depth_mm(time_s), bottom_mm = depth_mm(time_s - lag_s);
        const auto told = After(time_s, Dented(top_mm), Dented(bottom_mm));
        EXPECT_TRUE(told || top_mm - bottom_mm < 1)
            << lag_s << " s, ramp " << ramp_s << " s, " << top_mm << " mm and " << bottom_mm;
      }
      ASSERT_TRUE(motion_->disagreement().has_value()) << lag_s << " s, ramp " << ramp_s;
      if (lag_s < 0.3 * ramp_s || ramp_s > 1) continue;  // follows at once, nearly, or too slowly
      EXPECT_EQ(motion_->disagreement()->camera, CameraId::kBottom) << lag_s << " s, ramp " << ramp_s;
      EXPECT_NEAR(motion_->disagreement()->late_s, lag_s, 0.1) << ramp_s;
    }
  }
}

TEST_F(CameraMotionTest, ALagIsToldAtAnyFrameRate) {
  for (const double rate_hz : {10.0, 60.0}) {
    for (const double lag_s : {0.2, 0.5}) {
      motion_.emplace(model_, model_.nominal_rig, kNoisePx);
      const auto depth_mm = [&](double time_s) { return 8 * std::clamp(time_s / 0.3, 0.0, 1.0); };
      double told_s = 0;
      for (double time_s = 0; time_s < 1.5; time_s += 1 / rate_hz) {
        After(time_s, Dented(depth_mm(time_s - lag_s)), Dented(depth_mm(time_s)));
        if (motion_->disagreement()) told_s = std::max(told_s, motion_->disagreement()->late_s);
      }
      EXPECT_NEAR(told_s, lag_s, 0.11) << rate_hz << " Hz";
    }
  }
}

// A busy machine takes six of ten frames at 30 Hz, unevenly.
TEST_F(CameraMotionTest, ALagIsToldInSecondsWhereFramesAreSkipped) {
  for (unsigned seed = 1; seed <= 12; ++seed) {
    for (const double lag_s : {0.0, 0.2, 0.27, 0.5}) {
      motion_.emplace(model_, model_.nominal_rig, kNoisePx);
      std::mt19937 skips(seed);
      const auto depth_mm = [](double time_s) { return 3 - 3 * std::cos(4 * std::max(0.0, time_s)); };
      double least_s = 9, most_s = 0;
      for (int frame = 0; frame < 120; ++frame) {
        if (skips() % 10 < 4) continue;
        const double time_s = frame / 30.0;
        After(time_s, Dented(depth_mm(time_s - lag_s)), Dented(depth_mm(time_s)));
        const auto told = motion_->disagreement();
        if (frame >= 75) least_s = std::min(least_s, told ? told->late_s : 0);
        most_s = std::max(most_s, told ? told->late_s : 0);
      }
      EXPECT_NEAR(most_s, lag_s, 0.08) << "seed " << seed;
      EXPECT_NEAR(least_s, lag_s, 0.08) << "seed " << seed;
    }
  }
}

TEST_F(CameraMotionTest, AShortLagEndsWithTheNextPressThatBothSee) {
  for (const int lag : {3, 4}) {
    motion_.emplace(model_, model_.nominal_rig, kNoisePx);
    const auto tap_mm = [](double time_s) { return 6 * std::clamp(time_s / 0.1, 0.0, 1.0); };
    for (int frame = 0; frame < 40; ++frame)
      After(frame / 30.0, Dented(tap_mm(frame / 30.0)), Dented(tap_mm((frame - lag) / 30.0)));
    ASSERT_TRUE(motion_->disagreement() && motion_->disagreement()->late_s > 0) << lag << " frames";
    for (int frame = 40; frame < 120; ++frame) {
      const double turn = kPi * std::clamp((frame - 80) / 30.0 / 0.6, 0.0, 1.0);
      After(frame / 30.0, Dented(6 - 2.5 * (1 - std::cos(turn))));
    }
    EXPECT_FALSE(motion_->disagreement().has_value()) << lag << " frames";
  }
}

// Long after the onset a steady motion is alike at any time.
TEST_F(CameraMotionTest, ALagInASteadyMotionIsNotForgotten) {
  for (int frame = 0; frame < 200; ++frame) {
    const double time_s = frame / 30.0, speed_mm_s = 1.6;
    const auto told =
        After(time_s, Dented(speed_mm_s * time_s), Dented(speed_mm_s * std::max(0.0, time_s - 0.5)));
    EXPECT_TRUE(told || time_s < 0.4) << time_s;
  }
}

// A frame is missing in the middle: too few are left to tell a lag from a steady motion.
TEST_F(CameraMotionTest, ALagInASteadyMotionIsNotForgottenInAGap) {
  const auto depth_mm = [](double time_s) { return 8 * std::clamp(time_s / 0.4, 0.0, 1.0); };
  for (int frame = 0; frame < 21; ++frame)
    After(frame / 30.0, Dented(depth_mm(frame / 30.0 - 0.2)), Dented(depth_mm(frame / 30.0)));
  ASSERT_TRUE(motion_->disagreement().has_value());
  const auto back_mm = [](double time_s) { return 8 - 2 * std::clamp(time_s - 2, 0.0, 4.0); };
  for (int frame = 0; frame < 40; ++frame) {
    const double time_s = 3 + frame / 30.0;  // both move since long
    EXPECT_NE(After(time_s, Dented(back_mm(time_s - 0.2)), Dented(back_mm(time_s))), std::nullopt) << time_s;
  }
}

// A picture that is shown again, or an earlier one in its place, is no lag: the next one is in time.
TEST_F(CameraMotionTest, SingleStalePicturesAreNoLag) {
  for (unsigned seed = 1; seed <= 12; ++seed) {
    for (const int age : {1, 2, 5}) {
      motion_.emplace(model_, model_.nominal_rig, kNoisePx);
      std::mt19937 places(seed);
      std::array<std::set<int>, kCameraCount> stale;
      for (int begin = 0; begin < 120; begin += 15)
        for (auto& frames : stale) frames.insert(begin + static_cast<int>(places() % 13));
      const auto depth_mm = [&](int frame) {
        const double time_s = std::max(frame, 0) / 30.0;
        return seed % 2 == 0 ? 1.6 * time_s : 4 - 4 * std::cos(2 * time_s);
      };

      int frames_with_a_lag = 0;
      for (int frame = 0; frame < 120; ++frame) {
        const auto shown = [&](size_t camera) {
          return Dented(depth_mm(frame - (stale[camera].contains(frame) ? age : 0)));
        };
        After(frame / 30.0, shown(0), shown(1));
        const auto told = motion_->disagreement();
        frames_with_a_lag += told && told->late_s > 0;
      }
      EXPECT_EQ(frames_with_a_lag, 0) << "seed " << seed << ", " << age << " frames old";
    }
  }
}

TEST_F(CameraMotionTest, ASuspicionDoesNotOutliveAGapOrTheClock) {
  for (const double next_s : {0.5, -1.0}) {
    motion_.emplace(model_, model_.nominal_rig, kNoisePx);
    After(0, Dented(0));
    ASSERT_EQ(After(0.033, Dented(3), Dented(0)), CameraId::kTop);
    EXPECT_EQ(After(next_s, Dented(5)), std::nullopt) << next_s;
    for (int frame = 1; frame < 90; ++frame)
      EXPECT_EQ(After(next_s + frame / 30.0, Dented(5)), std::nullopt) << next_s << " s, frame " << frame;
  }
}

// Paths look alike: a camera that is turned by some of them has labels that fit.
TEST_F(CameraMotionTest, ACameraThatIsTurnedByPathsIsTold) {
  const Motion turned = [this](const Vec3& rest) {
    return Deform(model_, {{.angle_rad = 1 + kPi / 2, .z_mm = 90, .depth_mm = 3, .width_mm = 15}}, rest);
  };
  const Motion still = Dented(0);
  After(0, still);
  EXPECT_NE(After(0.033, Dented(3), turned), std::nullopt);
}

TEST_F(CameraMotionTest, ACameraThatMovesItselfIsTold) {
  const Motion still = Dented(3);
  After(0, still);
  EXPECT_EQ(
      After(0.033, [](const Vec3& rest) -> Vec3 { return rest + Vec3(0.8, 0, 0); }, still), CameraId::kTop);
}

TEST_F(CameraMotionTest, WhatWasToldIsForgotten) {
  After(0, Dented(0));
  ASSERT_EQ(After(0.033, Dented(3), Dented(0)), CameraId::kTop);
  ASSERT_EQ(After(0.066, Dented(4), Dented(0)), CameraId::kTop);
  for (double time_s = 0.1; time_s < 2.0; time_s += 0.1)
    EXPECT_NE(After(time_s, Dented(4), Dented(0)), std::nullopt);
  EXPECT_EQ(After(2.7, Dented(4), Dented(0)), std::nullopt);
}

TEST_F(CameraMotionTest, FramesFarApartOrWithoutATimeTellNothing) {
  After(0, Dented(0));
  EXPECT_EQ(After(1, Dented(5), Dented(0)), std::nullopt) << "either may have been seen within a second";
  EXPECT_EQ(After(-1, Dented(5), Dented(5)), std::nullopt);
  EXPECT_EQ(After(-1, Dented(0), Dented(5)), std::nullopt);
}

}  // namespace
}  // namespace taclink
