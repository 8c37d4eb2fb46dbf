#include "sensing/force/compliance_estimator.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "sensing/model/model_file.h"
#include "tests/sensing/force/support.h"

namespace taclink {
namespace {

double TotalN(const NodalForces& forces) {
  double total = 0;
  for (const auto& f : forces.forces_n) total += f.norm();
  return total;
}

class LinearModelTest : public testing::TestWithParam<std::string> {
 protected:
  const LinkModel model_ = LoadLinkModel(GetParam()).value();
  ComplianceEstimator estimator_{model_, ForceModel::kLinear, {}};
  NodalForces forces_;
};

TEST_P(LinearModelTest, ExactDataGiveTheLoadBack) {
  const int marker = model_.MarkerIndex(6, 4);
  estimator_.Estimate(ShapeUnder(model_, {{6, 4, 0.2}}, 0, 2, 0, 1), 0, forces_);
  EXPECT_EQ(forces_.loaded, std::vector<int>{marker});
  EXPECT_NEAR(forces_.forces_n[static_cast<size_t>(marker)].norm(), 0.2, 1e-6);
  EXPECT_LT(forces_.forces_n[static_cast<size_t>(marker)].dot(
                model_.OutwardNormal(model_.PathAngle(6), model_.markers.rings_z_mm[4])),
            0);
}

TEST_P(LinearModelTest, NoiseAloneGivesNoForce) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    estimator_.Estimate(ShapeUnder(model_, {}, 0, 3, 0.1, seed), 0, forces_);
    EXPECT_EQ(TotalN(forces_), 0) << "seed " << seed;
  }
}

TEST_P(LinearModelTest, NoisyPushIsFoundWithItsUncertainty) {
  int within_two_sigma = 0;
  const int trials = 30;
  for (unsigned seed = 0; seed < trials; ++seed) {
    estimator_.Estimate(ShapeUnder(model_, {{3, 5, 0.2}}, 0, 3, 0.1, seed), 0, forces_);
    EXPECT_NEAR(TotalN(forces_), 0.2, 0.02) << "seed " << seed;
    within_two_sigma +=
        std::abs(TotalN(forces_) - 0.2) < 2 * std::sqrt(forces_.loaded_covariance.sum()) ? 1 : 0;
  }
  EXPECT_GE(within_two_sigma, trials * 8 / 10);
}

TEST_P(LinearModelTest, TwoPushesAreToldApart) {
  estimator_.Estimate(ShapeUnder(model_, {{2, 3, 0.1}, {11, 7, 0.15}}, 0, 3, 0.05, 7), 0, forces_);
  double first = 0, second = 0;
  for (const int m : forces_.loaded) {
    (model_.RingOf(m) < 5 ? first : second) += forces_.forces_n[static_cast<size_t>(m)].norm();
  }
  EXPECT_NEAR(first, 0.1, 0.015);
  EXPECT_NEAR(second, 0.15, 0.02);
}

TEST_P(LinearModelTest, PressureIsNotAForce) {
  estimator_.Estimate(ShapeUnder(model_, {{6, 4, 0.2}}, 1e-3, 3, 0.05, 3), 1e-3, forces_);
  EXPECT_NEAR(TotalN(forces_), 0.2, 0.02);
  estimator_.Estimate(ShapeUnder(model_, {}, 1.5e-3, 3, 0.05, 4), 1.5e-3, forces_);
  EXPECT_EQ(TotalN(forces_), 0);
}

TEST_P(LinearModelTest, MissingMarkersAreLeftOut) {
  SkinShape shape = ShapeUnder(model_, {{6, 4, 0.2}}, 0, 3, 0.05, 9);
  for (size_t i = 0; i < shape.sources.size(); i += 3) {
    shape.sources[i] = MarkerSource::kInferred;
    shape.measured[i].displacement_mm = Vec3(50, 50, 50);
  }
  estimator_.Estimate(shape, 0, forces_);
  EXPECT_NEAR(TotalN(forces_), 0.2, 0.03);
}

TEST_P(LinearModelTest, NotANumberIsLeftOut) {
  SkinShape shape = ShapeUnder(model_, {{6, 4, 0.2}}, 0, 3, 0.05, 9);
  shape.measured[10].displacement_mm = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
  shape.measured[20].information_per_mm2(0, 0) = std::numeric_limits<double>::infinity();
  estimator_.Estimate(shape, 0, forces_);
  EXPECT_NEAR(TotalN(forces_), 0.2, 0.03);
}

INSTANTIATE_TEST_SUITE_P(ShippedModels, LinearModelTest, testing::Values("cylinder", "barrel"));

}  // namespace
}  // namespace taclink
