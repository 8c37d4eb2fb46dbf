#include "sensing/core/relaxation_filter.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <random>

namespace taclink {
namespace {

const Relaxation kOneTerm{.terms = {{0.2, 10}}, .share_sigmas = {}, .source = {}};
const Relaxation kTwoTerms{.terms = {{0.04, 5}, {0.05, 40}}, .share_sigmas = {}, .source = {}};

// Of a standard linear solid with g(t) = 1 - s (1 - exp(-t / tau)), the creep compliance in closed form
// [fung1993, section 2.11]: J(t) = 1 / (1 - s) - s / (1 - s) exp(-t (1 - s) / tau).
double Compliance(double share, double tau_s, double t_s) {
  return 1 / (1 - share) - share / (1 - share) * std::exp(-t_s * (1 - share) / tau_s);
}

TEST(RelaxationFilterTest, AStepOfStrainRelaxesAsTheSeriesSays) {
  for (const double dt_s : {0.5, 7.0}) {
    RelaxationFilter<double> filter(kTwoTerms, 0);
    filter.Advance(3, 0);
    for (double t = dt_s; t < 100; t += dt_s) {
      const double series = 1 - 0.04 * (1 - std::exp(-t / 5)) - 0.05 * (1 - std::exp(-t / 40));
      ASSERT_NEAR(filter.ToExternal(3, dt_s), 3 * series, 1e-12);
      filter.Advance(3, dt_s);
    }
  }
}

TEST(RelaxationFilterTest, AConstantLoadCreepsAsTheComplianceInClosedForm) {
  RelaxationFilter<double> filter(kOneTerm, 0);
  double dt_s = 0, most_off = 0;
  for (double t = 0; t < 60; t += dt_s) {
    const double elastic = filter.ToElastic(0.5, dt_s);
    most_off = std::max(most_off, std::abs(elastic / 0.5 - Compliance(0.2, 10, t)));
    filter.Advance(elastic, dt_s);
    dt_s = 0.05;
  }
  EXPECT_LT(most_off, 1e-6);
}

TEST(RelaxationFilterTest, ARemovedLoadLeavesWhatSuperpositionSays) {
  RelaxationFilter<double> filter(kOneTerm, 0);
  const double step_s = 0.02, held_s = 20;
  filter.Advance(filter.ToElastic(1, 0), 0);
  for (int i = 0; i < 1000; ++i) filter.Advance(filter.ToElastic(1, step_s), step_s);
  filter.Advance(filter.ToElastic(0, 0), 0);
  for (int i = 0; i <= 1000; ++i) {
    const double t = held_s + i * step_s;
    ASSERT_NEAR(filter.elastic(), Compliance(0.2, 10, t) - Compliance(0.2, 10, t - held_s), 1e-5) << t;
    filter.Advance(filter.ToElastic(0, step_s), step_s);
  }
  EXPECT_GT(filter.elastic(), 0.01);  // a dent remains
}

TEST(RelaxationFilterTest, RandomHistoriesComeBackWhateverTheStepsAndGaps) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  Eigen::VectorXd external = Eigen::VectorXd::Zero(5);
  RelaxationFilter<Eigen::VectorXd> creep(kTwoTerms, Eigen::VectorXd::Zero(5)), relaxation = creep;
  for (int i = 0; i < 2000; ++i) {
    for (double& one : external) one += uniform(random);
    const double dt_s = i % 100 == 0 ? 500 : i % 7 == 0 ? 0 : 0.3 * (1 + uniform(random));
    const Eigen::VectorXd elastic = creep.ToElastic(external, dt_s);
    const Eigen::VectorXd back = relaxation.ToExternal(elastic, dt_s);
    ASSERT_LT((back - external).cwiseAbs().maxCoeff(), 1e-12 * (1 + external.cwiseAbs().maxCoeff()));
    creep.Advance(elastic, dt_s);
    relaxation.Advance(elastic, dt_s);
  }
}

TEST(RelaxationFilterTest, IsExactForRampsWhateverTheirSteps) {
  RelaxationFilter<double> fine(kTwoTerms, 1), coarse = fine;
  for (int i = 1; i <= 1000; ++i) fine.Advance(1 + 0.004 * i, 0.03);
  coarse.Advance(5, 30);
  EXPECT_NEAR(fine.ToExternal(5, 1), coarse.ToExternal(5, 1), 1e-12);
}

TEST(RelaxationFilterTest, ForgetsInTheEnd) {
  RelaxationFilter<double> filter(kTwoTerms, 0);
  filter.Advance(2, 0);
  filter.Advance(2, 1e4);
  EXPECT_NEAR(filter.ToExternal(2, 0), 0.91 * 2, 1e-12);
  const RelaxationFilter<double> relaxed(kTwoTerms, 2);
  EXPECT_NEAR(relaxed.ToExternal(2, 0), 0.91 * 2, 1e-12);
  EXPECT_NEAR(relaxed.ToElastic(1.82, 3), 2, 1e-12);
}

TEST(RelaxationFilterTest, TellsHowTheForceDependsOnTheShares) {
  const double step = 1e-5;
  for (size_t term = 0; term < 2; ++term) {
    double external[2];
    for (const int side : {0, 1}) {
      Relaxation other = kTwoTerms;
      other.terms[term].share += side == 0 ? -step : step;
      RelaxationFilter<double> filter(other, 0);
      filter.Advance(1, 0);
      filter.Advance(1.5, 12);
      external[side] = filter.ToExternal(1.5, 0);
    }
    RelaxationFilter<double> filter(kTwoTerms, 0);
    filter.Advance(1, 0);
    filter.Advance(1.5, 12);
    EXPECT_NEAR(filter.ByShare(term), (external[1] - external[0]) / (2 * step), 1e-9);
  }
}

TEST(RelaxationFilterTest, StartsFromTwoForces) {
  RelaxationFilter<double> filter(kOneTerm, 0), again(kOneTerm, 0);
  for (const double elastic : {1.0, 3.0, 2.5}) filter.Advance(elastic, 4);
  again.Advance(2.5, 1e6);
  again.SetExternal(filter.ToExternal(2.5, 0));
  EXPECT_NEAR(again.ToExternal(1, 3), filter.ToExternal(1, 3), 1e-12);
}

TEST(RelaxationFilterTest, WithoutTermsIsTheIdentity) {
  RelaxationFilter<double> filter({}, 5);
  EXPECT_EQ(filter.ToElastic(3, 1), 3);
  EXPECT_EQ(filter.ToExternal(3, 1), 3);
}

}  // namespace
}  // namespace taclink
