// The decision when a baseline may follow, without cameras: a skin of a few markers, loads as the test says.
#include "sensing/pipeline/drift_follower.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace taclink {
namespace {

constexpr double kFrameS = 1 / 30.0;
constexpr int kMarkers = 6;

class DriftFollowerTest : public ::testing::Test {
 protected:
  // One frame; `off(t)` is what marker 2 is off, mm.
  void Frame(std::optional<double> load_n, double off_mm) {
    now_s_ += kFrameS;
    std::vector<Vec3> off(kMarkers, Vec3::Zero());
    off[2] = Vec3(off_mm, 0, 0);
    follower_.Update(static_cast<int64_t>(now_s_ * 1e9), load_n, off);
  }
  void Rest(double seconds) {
    for (double t = 0; t < seconds; t += kFrameS) Frame(0, 0);
  }
  double drift_mm() const { return follower_.drift_mm()[2].x(); }

  DriftOptions options_;
  DriftFollower follower_{kMarkers, options_};
  double now_s_ = 100;
};

TEST_F(DriftFollowerTest, FollowsOnlyAfterAQuietWhile) {
  Rest(options_.quiet_s - 0.5);
  EXPECT_FALSE(follower_.following());
  Rest(1);
  EXPECT_TRUE(follower_.following());
  Frame(options_.stop_n * 1.1, 0);
  EXPECT_FALSE(follower_.following());
  Rest(options_.quiet_s - 0.5);
  EXPECT_FALSE(follower_.following()) << "stopped for a while after a contact";
  Rest(1);
  EXPECT_TRUE(follower_.following());
}

TEST_F(DriftFollowerTest, HysteresisBetweenTheTwoForces) {
  Rest(options_.quiet_s + 1);
  const double between_n = (options_.go_n + options_.stop_n) / 2;
  for (int i = 0; i < 300; ++i) Frame(between_n, 0);
  EXPECT_TRUE(follower_.following());
  Frame(1, 0);
  for (int i = 0; i < 300; ++i) Frame(between_n, 0);
  EXPECT_FALSE(follower_.following()) << "not quiet enough to begin";
}

TEST_F(DriftFollowerTest, AnHourOfASteadyTouchDoesNotFade) {
  Rest(60);
  // 0.05 N pushes in by 0.3 mm within half a second, and is measured with noise; what the filter takes off
  // the displacement it takes off the force.
  std::mt19937 random(3);
  std::normal_distribution<double> noise_n(0, 0.004), noise_mm(0, 0.01);
  const auto touch = [&](double share) {
    const double felt_n = 0.05 * (share - drift_mm() / 0.3);
    Frame(felt_n + noise_n(random), 0.3 * share + noise_mm(random));
  };
  for (double t = 0; t < 0.5; t += kFrameS) touch(t / 0.5);
  ASSERT_FALSE(follower_.following());
  const double before_mm = drift_mm();
  for (double t = 0; t < 3600; t += kFrameS) touch(1);
  EXPECT_EQ(drift_mm(), before_mm);
  EXPECT_LT(std::abs(before_mm), 0.001) << "what was taken before it was felt: 0.3 % of the touch";
}

TEST_F(DriftFollowerTest, CreepIsFollowed) {
  // 0.01 mm a minute for an hour; a touch would be felt where 0.05 mm are not followed.
  double worst_mm = 0;
  for (double t = 0; t < 3600; t += kFrameS) {
    const double creep_mm = 0.01 * t / 60;
    Frame(0.02 * (creep_mm - drift_mm()) / 0.05, creep_mm);
    if (t > 10) worst_mm = std::max(worst_mm, creep_mm - drift_mm());
  }
  EXPECT_TRUE(follower_.following());
  EXPECT_NEAR(drift_mm(), 0.6, 0.011) << "behind by rate times time constant";
  EXPECT_LT(worst_mm, 0.011);
  EXPECT_DOUBLE_EQ(follower_.largest_mm(), drift_mm());
}

TEST_F(DriftFollowerTest, ASlowPressIsNotEaten) {
  Rest(60);
  // 0.1 mm/s; 0.17 N/mm as in the touch above.
  for (double t = 0; t < 20; t += kFrameS) {
    const double depth_mm = 0.1 * t;
    Frame(0.17 * (depth_mm - drift_mm()), depth_mm);
  }
  EXPECT_FALSE(follower_.following());
  EXPECT_LT(drift_mm(), 0.002) << "of 2 mm";
}

TEST_F(DriftFollowerTest, NothingMovesFasterThanTheLimit) {
  Rest(options_.quiet_s + 1);
  for (double t = 0; t < 10; t += kFrameS) Frame(0, 5);  // something that no force model feels
  EXPECT_NEAR(drift_mm(), options_.rate_limit_mm_s * 10, options_.rate_limit_mm_s * 0.1);
}

TEST_F(DriftFollowerTest, HoldsWhereNothingIsKnown) {
  Rest(options_.quiet_s + 1);
  Frame(std::nullopt, 1);
  EXPECT_FALSE(follower_.following());
  Rest(options_.quiet_s + 1);
  ASSERT_TRUE(follower_.following());
  now_s_ += 5;  // frames are missing
  Frame(0, 1);
  EXPECT_FALSE(follower_.following());
  EXPECT_EQ(drift_mm(), 0);
  now_s_ -= 50;  // the source began again
  Frame(0, 1);
  EXPECT_FALSE(follower_.following());
  EXPECT_EQ(drift_mm(), 0);
}

TEST_F(DriftFollowerTest, ANewBaselineBeginsAtZero) {
  for (double t = 0; t < 60; t += kFrameS) Frame(0, 0.2);
  ASSERT_GT(drift_mm(), 0.01);
  follower_.Reset();
  EXPECT_EQ(follower_.largest_mm(), 0);
  EXPECT_EQ(drift_mm(), 0);
  EXPECT_FALSE(follower_.following());
}

}  // namespace
}  // namespace taclink
