#include "sensing/acceptance/statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace taclink {
namespace {

TEST(Statistics, StudentTIsThatOfTheTables) {
  EXPECT_NEAR(StudentT95(1), 12.706, 1e-3);
  EXPECT_NEAR(StudentT95(4), 2.776, 1e-3);
  EXPECT_NEAR(StudentT95(1e6), 1.960, 1e-3);
}

TEST(Statistics, FewDataHaveNoWidth) {
  EXPECT_EQ(GroupedMean({}).samples, 0);
  const std::vector<GroupedValue> one = {{3, 1.0}, {3, 2.0}};
  EXPECT_EQ(GroupedMean(one).value, 1.5);
  EXPECT_FALSE(GroupedMean(one).half_width);
  EXPECT_FALSE(GroupedPercentile(one, 0.95).high);
  EXPECT_EQ(PooledDeviation(std::vector<GroupedValue>{{1, 1.0}, {2, 2.0}}).samples, 0);
  EXPECT_FALSE(FitLine(one, std::vector<double>{1, 2}, 0)->slope.half_width) << "two points of one place";
  EXPECT_FALSE(FitLine(std::vector<GroupedValue>{{1, 2.0}, {2, 3.0}}, std::vector<double>{1, 2}, 0));
}

// A sensor's noise about one pressure tells no slope.
TEST(Statistics, ALineNeedsASpan) {
  const std::vector<GroupedValue> x = {{1, 1.000}, {1, 1.001}, {2, 0.999}, {2, 1.000}};
  EXPECT_FALSE(FitLine(x, std::vector<double>{0.01, -0.01, 0.02, 0}, 0.2));
}

// Places at one pressure tell of no slope, and count for none of its certainty.
TEST(Statistics, PlacesWithoutASpanGiveALineNoCertainty) {
  const std::vector<GroupedValue> x = {{0, 0}, {0, 1}, {1, 0}, {2, 0}, {3, 0}, {4, 0}};
  const auto line = FitLine(x, std::vector<double>{0.01, 0.09, 0, 0.02, 0.01, 0.03}, 0.2);
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->slope.value, 0.08, 1e-12);
  EXPECT_EQ(line->slope.samples, 1);
  EXPECT_FALSE(line->slope.half_width);
}

TEST(Statistics, OneGroupsInterceptHasAWidth) {
  const auto line = FitLine(std::vector<GroupedValue>{{0, 0}, {0, 1}, {0, 2}, {0, 3}},
                            std::vector<double>{0.1, 1.0, 2.1, 3.0}, 0.2);
  ASSERT_TRUE(line && line->intercept.half_width);
  EXPECT_GT(*line->intercept.half_width, 0.05);
  EXPECT_LT(*line->intercept.half_width, 0.5);
}

// Loads at one place share an error that is larger than what differs between repetitions. An interval that
// took each load as independent would hold the truth in about 60 of 100 cases.
TEST(Statistics, IntervalsHoldTheTruthAsOftenAsTheySay) {
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  constexpr int kTrials = 2000, kPlaces = 5, kRepetitions = 4;
  constexpr double kTruth = 0.07, kSlope = 0.3, kPlaceSigma = 0.04, kLoadSigma = 0.02;
  int mean_held = 0, slope_held = 0, deviation_held = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<GroupedValue> values, x;
    std::vector<double> y;
    for (int place = 0; place < kPlaces; ++place) {
      const double own = kTruth + kPlaceSigma * normal(random), own_slope = kSlope + 0.05 * normal(random);
      for (int i = 0; i < kRepetitions; ++i) {
        const double value = own + kLoadSigma * normal(random);
        values.push_back({place, value});
        x.push_back({place, i % 2 + 0.1 * i});
        y.push_back(value + own_slope * x.back().value);
      }
    }
    const Estimate mean = GroupedMean(values);
    mean_held += std::abs(mean.value - kTruth) <= mean.half_width.value() ? 1 : 0;
    const auto line = FitLine(x, y, 0.2);
    ASSERT_TRUE(line && line->slope.half_width);
    slope_held += std::abs(line->slope.value - kSlope) <= *line->slope.half_width ? 1 : 0;
    const PercentileEstimate deviation = PooledDeviation(values);
    deviation_held += *deviation.low <= kLoadSigma && kLoadSigma <= *deviation.high ? 1 : 0;
  }
  EXPECT_NEAR(mean_held, 0.95 * kTrials, 0.02 * kTrials);
  EXPECT_NEAR(deviation_held, 0.95 * kTrials, 0.02 * kTrials);
  EXPECT_GE(slope_held, 0.93 * kTrials);
  EXPECT_LE(slope_held, kTrials - 1);
}

TEST(Statistics, LineGoesThroughExactPointsOfEveryGroup) {
  const std::vector<GroupedValue> x = {{0, 0}, {0, 1}, {1, 0}, {1, 2}};
  const auto line = FitLine(x, std::vector<double>{1, 3, -1, 3}, 0.2);
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->slope.value, 2, 1e-12);
  EXPECT_NEAR(line->intercept.value, 0, 1e-12);
  EXPECT_NEAR(line->slope.half_width.value(), 0, 1e-9);
}

TEST(Statistics, PercentileOfManyGroupsIsNarrowAndOfFewIsWide) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const auto width = [&](int groups) {
    std::vector<GroupedValue> values;
    for (int i = 0; i < groups; ++i) values.push_back({i, std::abs(normal(random))});
    const PercentileEstimate estimate = GroupedPercentile(values, 0.95);
    EXPECT_LE(*estimate.low, estimate.value);
    EXPECT_GE(*estimate.high, estimate.value);
    return *estimate.high - *estimate.low;
  };
  EXPECT_LT(width(2000), 0.25);
  EXPECT_GT(width(6), 0.4);
}

}  // namespace
}  // namespace taclink
