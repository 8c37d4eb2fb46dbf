// Limits of detection against loads of a finer shell.
#include <random>

#include "tests/sensing/estimation/pushed_skin.h"

namespace taclink {
namespace {

constexpr double kSigmaMm = 0.05;
constexpr int kTimes = 12;

class DetectionLimitsTest : public SkinEstimatorTest {
 protected:
  // In how many of kTimes with noise something was.
  int Found(const Pushed& pushed, double kpa) {
    EXPECT_TRUE(pushed.ok);
    int count = 0;
    for (int i = 0; i < kTimes; ++i) {
      Eigen::VectorXd seen_mm = pushed.markers_mm;
      for (double& u : seen_mm) u += noise_(random_);
      estimator_.Estimate(Observe(seen_mm, kpa, kSigmaMm), estimate_);
      EXPECT_EQ(estimate_.failure, EstimateFailure::kNone);
      count += estimate_.loads.loads.empty() ? 0 : 1;
    }
    return count;
  }

 private:
  std::mt19937 random_{11};
  std::normal_distribution<double> noise_{0, kSigmaMm};
};

// A body that presses as much is found with noise, one that presses half of it seldom; where markers are
// hidden it has to press more.
TEST_F(DetectionLimitsTest, AreWhereBodiesBeginToBeFound) {
  constexpr double kKpa = 1, kAngle = 1.3, kZMm = 95;
  const Vec3 place = model_.PointAtDepth(kAngle, kZMm, model_.thickness_mm / 2);
  const auto limit_n = [&] {
    int nearest = 0;
    const auto off = [&](int site) { return (estimator_.mechanics().RestSite(site) - place).norm(); };
    for (int site = 1; site < estimator_.mechanics().site_count(); ++site) {
      if (off(site) < off(nearest)) nearest = site;
    }
    return estimator_.Limits().by_site_n[nearest];
  };
  const auto found = [&](double force_n) {
    return Found(Push(model_, kKpa, kAngle, kZMm, force_n, 4), kKpa);
  };
  EXPECT_LE(found(0), 1);
  const double limit = limit_n();
  EXPECT_GT(estimator_.Limits().by_site_n.minCoeff(), 0);
  EXPECT_TRUE(estimator_.Limits().by_site_n.allFinite());
  EXPECT_GE(found(1.2 * limit), kTimes - 1);
  EXPECT_LE(found(0.4 * limit), kTimes / 3);

  SkinObservation hidden = Observe(Push(model_, kKpa, kAngle, kZMm, 0, 4).markers_mm, kKpa, kSigmaMm);
  estimator_.Estimate(hidden, estimate_);
  const double all_seen = limit_n();
  for (int m = 0; m < model_.markers.count(); ++m) {
    if ((model_.RestMarker(m) - place).norm() < 25)
      hidden.markers.information[static_cast<size_t>(m)].setZero();
  }
  estimator_.Estimate(hidden, estimate_);
  ASSERT_TRUE(estimate_.loads.loads.empty());
  EXPECT_GT(limit_n(), 1.5 * all_seen);
}

// As much all around is found with noise wherever it presses, a third of it nowhere, slack and inflated.
TEST_F(DetectionLimitsTest, OfWhatPressesAllAround) {
  for (const double kpa : {0.0, 1.0}) {
    const auto found = [&](double z_mm, double force_n) {
      return Found(Push(model_, kpa, {}, z_mm, force_n, 5), kpa);
    };
    EXPECT_LE(found(95, 0), 1);
    const double limit_n = estimator_.Limits().around_n;
    for (const double z_mm : {50.0, 110.0}) {
      EXPECT_GE(found(z_mm, 1.2 * limit_n), kTimes - 1) << kpa << " kPa, " << z_mm << " mm";
      EXPECT_LE(found(z_mm, 0.33 * limit_n), 1) << kpa << " kPa, " << z_mm << " mm";
    }
  }
}

}  // namespace
}  // namespace taclink
