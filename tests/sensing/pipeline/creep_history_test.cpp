#include "sensing/pipeline/creep_history.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "sensing/model/model_file.h"

namespace taclink {
namespace {

constexpr double kShare = 0.2, kTimeS = 10;

// Of one term [fung1993, section 2.11], from 0 on.
double Compliance(double t_s) {
  return t_s < 0 ? 0 : 1 / (1 - kShare) - kShare / (1 - kShare) * std::exp(-t_s * (1 - kShare) / kTimeS);
}

class CreepHistoryTest : public ::testing::Test {
 protected:
  static LinkModel Creeping() {
    LinkModel model = LoadLinkModel("cylinder").value();
    model.relaxation.terms = {{kShare, kTimeS}};
    return model;
  }

  struct Pressed {
    int marker = 0;
    double elastic_n = 0;
  };
  // What the history makes of these loads at a time, each lumped at one marker.
  std::vector<EstimatedLoad> At(double time_s, const std::vector<Pressed>& pressed, double sigma_n = 0.002) {
    history_.Elastic({}, {}, static_cast<int64_t>(1e9 * time_s) + 1);
    CreepHistory::LumpedForces lumped;
    std::vector<EstimatedLoad> loads;
    for (const auto& [marker, elastic_n] : pressed) {
      const Vec3 inward =
          -model_.OutwardNormal(model_.PathAngle(model_.PathOf(marker)),
                                model_.markers.rings_z_mm[static_cast<size_t>(model_.RingOf(marker))]);
      lumped.emplace_back(Eigen::VectorXd::Zero(3 * model_.markers.count()));
      lumped.back().segment<3>(3 * marker) = elastic_n * inward;
      EstimatedLoad& load = loads.emplace_back();
      load.sites = {marker};
      load.inward_n = {elastic_n};
      load.normal_force_n = elastic_n;
      load.force_n = elastic_n * inward;
      load.force_covariance_n2 = sigma_n * sigma_n * Mat3::Identity();
    }
    history_.MakeReal(lumped, loads);
    history_.Advance();
    return loads;
  }

  const LinkModel model_ = Creeping();
  CreepHistory history_{model_};
};

TEST_F(CreepHistoryTest, ALoadThatIsHeldStaysAndOneThatIsRemovedIsNone) {
  for (double t = 0; t < 30; t += 0.1) {
    // An estimate finds the same load now at one marker, now at its neighbor.
    const int marker = model_.MarkerIndex(static_cast<int>(10 * t) % 2, 4);
    const auto loads = At(t, {{marker, 0.5 * Compliance(t)}});
    ASSERT_EQ(loads.size(), 1u);
    ASSERT_NEAR(loads[0].normal_force_n, 0.5, 2e-4) << t;
    ASSERT_NEAR(loads[0].inward_n[0], 0.5, 2e-4) << t;
    ASSERT_NEAR(loads[0].force_n.norm(), 0.5, 2e-4) << t;
  }
  EXPECT_NEAR(history_.ResidualInward().sum(), 0.5 * (Compliance(30) - 1), 2e-3);
  for (double t = 30.1; t < 60; t += 0.1)
    ASSERT_TRUE(At(t, {{model_.MarkerIndex(1, 4), 0.5 * (Compliance(t) - Compliance(t - 30.05))}}).empty())
        << t;
}

TEST_F(CreepHistoryTest, WhatPressesOnADentThatRecoversIsAllThatIsFelt) {
  for (double t = 0; t <= 30; t += 0.1) At(t, {{100, 0.5 * Compliance(t)}});
  for (double t = 30.1; t < 40; t += 0.1) {
    const double left_n = 0.5 * (Compliance(t) - Compliance(t - 30.05));
    const auto loads = At(t, {{100, left_n + 0.3 * Compliance(t - 30.1)}, {20, 0.1 * Compliance(t - 30.1)}});
    ASSERT_EQ(loads.size(), 2u) << t;
    ASSERT_NEAR(loads[0].normal_force_n, 0.3, 2e-3) << t;
    ASSERT_NEAR(loads[1].normal_force_n, 0.1, 1e-3) << t;  // far from the dent
  }
}

TEST_F(CreepHistoryTest, AGapCountsAsAnEvenChange) {
  At(0, {{100, 0.5}});
  const auto loads = At(100, {{100, 0.5 / (1 - kShare)}});
  ASSERT_EQ(loads.size(), 1u);
  // The elastic force rose evenly from 0.5 N, which came at once.
  const double slope = (0.5 / (1 - kShare) - 0.5) / 100;
  const double memory = 0.5 * std::exp(-10) + slope * kTimeS * (1 - std::exp(-10));
  EXPECT_NEAR(loads[0].normal_force_n, (1 - kShare) * 0.5 / (1 - kShare) + kShare * memory, 1e-9);
}

TEST_F(CreepHistoryTest, TheFirstPressureCountsAsOldAndAStepCreeps) {
  const auto pressure_at = [&](double time_s, double mpa) {
    return history_.Elastic({.pressure_mpa = mpa}, {}, static_cast<int64_t>(1e9 * time_s) + 1);
  };
  for (double t = 0; t < 5; t += 0.5)
    EXPECT_NEAR(pressure_at(t, 1e-3).pressure_mpa, 1e-3 / (1 - kShare), 1e-12);
  for (double t = 5; t < 40; t += 0.05) {
    const MeasuredLoads loads = pressure_at(t, 2e-3);
    ASSERT_NEAR(loads.pressure_mpa, 1e-3 / (1 - kShare) + 1e-3 * Compliance(t - 4.75), 3e-6) << t;
    ASSERT_NEAR(loads.Real().pressure_mpa, 2e-3, 1e-15);
  }
}

TEST_F(CreepHistoryTest, TheSharesUncertaintyIsInTheForces) {
  LinkModel model = model_;
  model.relaxation.share_sigmas = {0.1};
  history_ = CreepHistory(model);
  At(0, {{100, 0.5}}, 0);
  At(9.9, {{100, 0.5}}, 0);
  const auto loads = At(10, {{100, 0.5}}, 0);
  ASSERT_EQ(loads.size(), 1u);
  // The force of a held strain is 0.5 N (1 - share (1 - exp(-t / time))).
  EXPECT_NEAR(std::sqrt(loads[0].force_covariance_n2.trace()), 0.1 * 0.5 * (1 - std::exp(-1)), 5e-4);
}

TEST_F(CreepHistoryTest, TimeThatGoesBackForgets) {
  for (double t = 10; t <= 40; t += 0.1) At(t, {{100, 0.5 * Compliance(t - 10)}});
  const auto loads = At(5, {{100, 0.6}});
  ASSERT_EQ(loads.size(), 1u);
  EXPECT_EQ(loads[0].normal_force_n, 0.6);
}

TEST_F(CreepHistoryTest, AnElasticSkinHasNone) {
  CreepHistory none(LoadLinkModel("cylinder").value());
  EXPECT_FALSE(none.any());
  EXPECT_EQ(none.Elastic({.pressure_mpa = 0.3}, {}, 5).pressure_mpa, 0.3);
  EXPECT_EQ(none.ResidualInward().size(), 0);
}

}  // namespace
}  // namespace taclink
