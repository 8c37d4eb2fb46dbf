// Frames in which a contact stands: they are answered without a search.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "sensing/shell/pressed_skin.h"
#include "tests/sensing/estimation/pushed_skin.h"

namespace taclink {
namespace {

constexpr double kNoiseMm = 0.05, kStandingKpa = 1, kStandingAngle = 1.3, kStandingZ = 95;

class StandingSkinTest : public SkinEstimatorTest {
 protected:
  SkinObservation Noisy(const Eigen::VectorXd& markers_mm, double kpa = kStandingKpa) {
    std::normal_distribution<double> normal(0, kNoiseMm);
    Eigen::VectorXd seen_mm = markers_mm;
    for (double& coordinate : seen_mm) coordinate += normal(random_);
    return Observe(seen_mm, kpa, kNoiseMm);
  }
  // That of an estimator that saw only this frame.
  void ExpectColdAnswer(const SkinObservation& seen) {
    SkinEstimator fresh(model_);
    SkinEstimate cold;
    fresh.Estimate(seen, cold);
    ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
    ASSERT_EQ(estimate_.loads.loads.size(), cold.loads.loads.size());
    for (size_t i = 0; i < cold.loads.loads.size(); ++i) {
      const EstimatedLoad &one = cold.loads.loads[i], &other = estimate_.loads.loads[i];
      EXPECT_LT((one.force_n - other.force_n).norm(), 0.2 * std::sqrt(one.force_covariance_n2.trace()));
      EXPECT_LT((one.center - other.center).norm(), 0.5 * std::sqrt(one.center_covariance.trace()));
    }
    EXPECT_LT((cold.displacements_mm - estimate_.displacements_mm).cwiseAbs().maxCoeff(), kNoiseMm);
    EXPECT_NEAR(cold.known_loads.pressure_mpa, estimate_.known_loads.pressure_mpa, 1e-5);
    EXPECT_NEAR(cold.loads.chi2_per_dof, estimate_.loads.chi2_per_dof, 0.05);
  }

  std::mt19937 random_{3};
};

TEST_F(StandingSkinTest, AnswersAsIfEachFrameWereTheFirst) {
  for (const double force_n : {0.05, 0.4}) {
    const Pushed pushed = Push(model_, kStandingKpa, kStandingAngle, kStandingZ, force_n, 4);
    ASSERT_TRUE(pushed.ok);
    int steps = 0;
    for (int frame = 0; frame < 8; ++frame) {
      const SkinObservation seen = Noisy(pushed.markers_mm);
      estimator_.Estimate(seen, estimate_);
      steps += estimate_.work.steps;
      ExpectColdAnswer(seen);
    }
    EXPECT_LT(steps, 8 * 2);
  }
}

TEST_F(StandingSkinTest, FollowsThePressure) {
  const Pushed pushed = Push(model_, kStandingKpa, kStandingAngle, kStandingZ, 0.4, 4);
  ASSERT_TRUE(pushed.ok);
  for (const double kpa : {1.0, 1.005, 0.995, 1.01}) {
    const Pushed now = Push(model_, kpa, kStandingAngle, kStandingZ, 0.4, 4);
    ASSERT_TRUE(now.ok);
    const SkinObservation seen = Noisy(now.markers_mm, kpa);
    estimator_.Estimate(seen, estimate_);
    ExpectColdAnswer(seen);
  }
}

// Each step is less than noise.
TEST_F(StandingSkinTest, FollowsAContactThatCreeps) {
  for (double force_n = 0.3; force_n < 0.36; force_n += 0.005) {
    const Pushed pushed = Push(model_, kStandingKpa, kStandingAngle, kStandingZ, force_n, 4);
    ASSERT_TRUE(pushed.ok);
    const SkinObservation seen = Noisy(pushed.markers_mm);
    estimator_.Estimate(seen, estimate_);
    ASSERT_EQ(estimate_.loads.loads.size(), 1u);
    ExpectColdAnswer(seen);
  }
}

// As weak as a skin that is otherwise untouched shows it.
TEST_F(StandingSkinTest, FindsAWeakBodyBesideIt) {
  const Pushed none = Push(model_, kStandingKpa, kStandingAngle, kStandingZ, 0, 4),
               first = Push(model_, kStandingKpa, kStandingAngle, kStandingZ, 0.4, 4);
  ASSERT_TRUE(none.ok && first.ok);
  for (double force_n = 0.02; force_n < 0.06; force_n += 0.01) {
    const Pushed second = Push(model_, kStandingKpa, -1.8, 150, force_n, 4);
    ASSERT_TRUE(second.ok);
    for (int frame = 0; frame < 3; ++frame) estimator_.Estimate(Noisy(first.markers_mm), estimate_);
    ASSERT_EQ(estimate_.loads.loads.size(), 1u);
    const SkinObservation seen = Noisy(first.markers_mm + second.markers_mm - none.markers_mm);
    estimator_.Estimate(seen, estimate_);
    ExpectColdAnswer(seen);
  }
}

// What was enough to tell that nothing drags is not what a drag is estimated with.
TEST_F(StandingSkinTest, BeginsToDrag) {
  PressedSkin skin(model_, {});
  ASSERT_TRUE(skin.Inflate(1e-3 * kStandingKpa).ok());
  const auto node = static_cast<size_t>(skin.mesh().NodeOfMarker(model_, model_.MarkerIndex(6, 4)));
  const Vec3 outward = skin.mesh().normals[node];
  skin.AddBody(RigidStamp{skin.state().mids_mm[node] + model_.thickness_mm / 2 * outward, -outward, 2.75},
               true);
  const auto see = [&] {
    Eigen::VectorXd markers_mm(3 * model_.markers.count());
    for (int m = 0; m < model_.markers.count(); ++m)
      markers_mm.segment<3>(3 * m) = skin.Marker(m) - model_.RestMarker(m);
    return Noisy(markers_mm);
  };
  const Vec3 in = -5 * outward, along = 0.4 * Vec3::UnitZ();
  ASSERT_TRUE(skin.Move({&in, 1}).ok());
  for (int frame = 0; frame < 4; ++frame) estimator_.Estimate(see(), estimate_);
  ASSERT_EQ(estimate_.loads.loads.size(), 1U);
  EXPECT_FALSE(estimate_.loads.loads[0].has_tangential);
  for (int frame = 0; frame < 8; ++frame) {
    ASSERT_TRUE(skin.Move({&along, 1}).ok());
    const SkinObservation seen = see();
    estimator_.Estimate(seen, estimate_);
    ExpectColdAnswer(seen);
  }
  EXPECT_TRUE(estimate_.loads.loads.at(0).has_tangential);
}

// It was left out in the first frame, and must not come back because it stays where it is.
TEST_F(StandingSkinTest, AWrongMarkerThatStaysIsLeftOut) {
  const Pushed pushed = Push(model_, kStandingKpa, kStandingAngle, kStandingZ, 0.4, 4);
  ASSERT_TRUE(pushed.ok);
  Eigen::VectorXd wrong_mm = pushed.markers_mm;
  wrong_mm.segment<3>(3 * model_.MarkerIndex(20, 5)) += Vec3(6, -7, 5);
  for (int frame = 0; frame < 3; ++frame) {
    const SkinObservation seen = Noisy(wrong_mm);
    estimator_.Estimate(seen, estimate_);
    ExpectColdAnswer(seen);
  }
}

// A body leaves, or presses more: nothing of the frames before stands.
TEST_F(StandingSkinTest, EndsWithWhatMoves) {
  const Pushed pushed = Push(model_, kStandingKpa, kStandingAngle, kStandingZ, 0.4, 4),
               none = Push(model_, kStandingKpa, kStandingAngle, kStandingZ, 0, 4);
  ASSERT_TRUE(pushed.ok && none.ok);
  for (int frame = 0; frame < 3; ++frame) estimator_.Estimate(Noisy(pushed.markers_mm), estimate_);
  const SkinObservation left = Noisy(none.markers_mm);
  estimator_.Estimate(left, estimate_);
  EXPECT_TRUE(estimate_.loads.loads.empty());
  for (int frame = 0; frame < 3; ++frame) estimator_.Estimate(Noisy(pushed.markers_mm), estimate_);
  const Pushed more = Push(model_, kStandingKpa, kStandingAngle, kStandingZ, 0.5, 4);
  ASSERT_TRUE(more.ok);
  const SkinObservation seen = Noisy(more.markers_mm);
  estimator_.Estimate(seen, estimate_);
  ExpectColdAnswer(seen);
}

}  // namespace
}  // namespace taclink
