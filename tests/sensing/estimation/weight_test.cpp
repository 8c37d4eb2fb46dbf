// A skin with weight, in other attitudes than that of its baseline. Truth: the nonlinear shell on a finer
// mesh.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "pushed_skin.h"

namespace taclink {
namespace {

const Vec3 kUpright(0, 0, -9.81), kLying(0, -9.81, 0), kTilted(4.9, -6.94, -4.9);

class WeightTest : public ::testing::Test {
 protected:
  SkinObservation Moved(const Pushed& baseline, const Pushed& now, double kpa) {
    std::normal_distribution<double> noise(0, 0.03);
    Eigen::VectorXd moved_mm = now.markers_mm - baseline.markers_mm;
    for (double& u : moved_mm) u += noise(random_);
    SkinObservation observation = Observe(moved_mm, kpa, 0.03);
    observation.baseline_loads = {kpa * 1e-3, 3e-5};
    return observation;
  }
  static void Tell(const Vec3& mps2, double sigma_mps2, MeasuredLoads& loads) {
    loads.specific_force_mps2 = mps2;
    loads.specific_force_covariance = sigma_mps2 * sigma_mps2 * Mat3::Identity();
  }
  // Of any direction.
  static void TellNothing(MeasuredLoads& loads) { Tell(Vec3::Zero(), 9.81 / std::sqrt(3), loads); }
  static double Degrees(const Vec3& a, const Vec3& b) {
    return DegFromRad(std::atan2(a.cross(b).norm(), a.dot(b)));
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  SkinEstimator estimator_{model_};
  SkinEstimate estimate_;
  std::mt19937 random_{7};
};

TEST_F(WeightTest, IsNoForce) {
  for (const double kpa : {0.0, 1.0}) {
    const Pushed baseline = Push(model_, kpa, 1.3, 95, 0, 4, kUpright);
    ASSERT_TRUE(baseline.ok);
    for (const Vec3& now : {kLying, kTilted, Vec3(-kLying)}) {
      const Pushed turned = Push(model_, kpa, 1.3, 95, 0, 4, now);
      ASSERT_TRUE(turned.ok);
      SkinObservation observation = Moved(baseline, turned, kpa);
      for (const bool is_known : {true, false}) {
        Tell(kUpright, 0.2, observation.baseline_loads);
        Tell(now, 0.2, observation.loads);
        if (!is_known) TellNothing(observation.loads);
        estimator_.Estimate(observation, estimate_);
        ASSERT_EQ(estimate_.failure, EstimateFailure::kNone) << now.transpose() << " " << is_known;
        EXPECT_TRUE(estimate_.loads.loads.empty()) << now.transpose() << " " << is_known << " " << kpa;
        EXPECT_LT(estimate_.loads.chi2_per_dof, 2);
        const Vec3 found = estimate_.known_loads.specific_force_mps2;
        EXPECT_LT(Degrees(found, now), 5) << found.transpose() << ", not " << now.transpose();
        const Vec3 sigmas = estimate_.loads.known_covariance.diagonal().tail<3>().cwiseSqrt();
        EXPECT_TRUE(((found - now).array().abs() < 4 * sigmas.array()).all())
            << found.transpose() << " +- " << sigmas.transpose();
      }
    }
  }
}

TEST_F(WeightTest, LeavesContactsAsTheyAre) {
  for (const double force_n : {0.05, 0.1, 0.3}) {
    const double kpa = force_n > 0.2 ? 0.5 : 0;  // else the dent is half the radius deep
    const Pushed baseline = Push(model_, kpa, 1.3, 95, 0, 4, kUpright);
    const Pushed pressed = Push(model_, kpa, 1.3, 95, force_n, 4, kLying);
    ASSERT_TRUE(baseline.ok && pressed.ok);
    SkinObservation observation = Moved(baseline, pressed, kpa);
    const Vec3 truth = -force_n * model_.OutwardNormal(1.3, 95);
    for (const bool is_known : {true, false}) {
      Tell(kUpright, 0.2, observation.baseline_loads);
      Tell(kLying, 0.2, observation.loads);
      if (!is_known) TellNothing(observation.loads);
      estimator_.Estimate(observation, estimate_);
      ASSERT_EQ(estimate_.failure, EstimateFailure::kNone) << is_known;
      // The weakest one may be told as two neighbors: chi^2 per number is 0.61 to 0.62 with either, so that
      // rounding decides.
      ASSERT_GE(estimate_.loads.loads.size(), 1U) << is_known << " " << force_n;
      EXPECT_LE(estimate_.loads.loads.size(), force_n < 0.1 ? 2U : 1U) << is_known << " " << force_n;
      Vec3 sum = Vec3::Zero();
      for (const EstimatedLoad& load : estimate_.loads.loads) {
        sum += load.force_n;
        EXPECT_LT((load.center - Vec2(5, 9.6)).norm(), 2.5) << is_known << " " << load.center.transpose();
      }
      EXPECT_LT((sum - truth).norm(), std::max(0.015, 0.1 * force_n)) << is_known << " " << sum.transpose();
    }
  }
}

// The same as without weight where the attitude is that of the baseline.
TEST_F(WeightTest, OfALinkThatNeverTurnsCancels) {
  const Pushed baseline = Push(model_, 0, 1.3, 95, 0, 4, kLying);
  const Pushed pressed = Push(model_, 0, 1.3, 95, 0.15, 4, kLying);
  ASSERT_TRUE(baseline.ok && pressed.ok);
  SkinObservation observation = Moved(baseline, pressed, 0);
  Tell(kLying, 0, observation.baseline_loads);
  Tell(kLying, 0, observation.loads);
  estimator_.Estimate(observation, estimate_);
  ASSERT_EQ(estimate_.failure, EstimateFailure::kNone);
  ASSERT_EQ(estimate_.loads.loads.size(), 1u);
  EXPECT_NEAR(estimate_.loads.loads[0].normal_force_n, 0.15, 0.015);
}

}  // namespace
}  // namespace taclink
