#include "sensing/identification/relaxation_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace taclink {
namespace {

using ::testing::HasSubstr;

constexpr double kPressedS = 2, kReleasedS = 182, kEndS = 300;

// Springs with dashpots in a row, beside a spring, under a force from kPressedS to kReleasedS: forward
// differences of the dashpots' strains.
RelaxationRecord HeldForce(const std::vector<RelaxationTerm>& terms, double force_n, double gain,
                           double sigma_n, std::mt19937& random) {
  constexpr int kStepsPerS = 200;
  std::normal_distribution<double> noise(0, sigma_n);
  RelaxationRecord record{.name = "held", .samples = {}};
  std::vector<double> dashpots(terms.size(), 0);
  for (int step = 0; step < kEndS * kStepsPerS; ++step) {
    const double t = static_cast<double>(step) / kStepsPerS;
    const double reference_n = t >= kPressedS && t < kReleasedS ? force_n : 0;
    double elastic_n = reference_n;
    for (size_t i = 0; i < terms.size(); ++i) elastic_n += terms[i].share * dashpots[i];
    for (size_t i = 0; i < terms.size(); ++i)
      dashpots[i] += (elastic_n - dashpots[i]) / (terms[i].time_s * kStepsPerS);
    if (step % kStepsPerS == 0) record.samples.push_back({t, gain * elastic_n + noise(random), reference_n});
  }
  return record;
}

TEST(RelaxationFitTest, FindsOneTermAndHowWellItIsKnown) {
  constexpr int kDraws = 30;
  constexpr double kShare = 0.08, kTimeS = 20;
  std::mt19937 random(3);
  int within_one = 0, within_two = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    const RelaxationRecord records[] = {HeldForce({{kShare, kTimeS}}, 0.5, 1.04, 0.01, random),
                                        HeldForce({{kShare, kTimeS}}, 0.3, 0.97, 0.01, random)};
    const auto fit = FitRelaxation(records);
    ASSERT_TRUE(fit.ok()) << fit.error().message;
    ASSERT_EQ(fit->terms.size(), 1u);
    ASSERT_EQ(fit->share_sigmas.size(), 1u);
    EXPECT_LT(fit->share_sigmas[0], 0.01);
    EXPECT_NEAR(fit->terms[0].time_s, kTimeS, 0.4 * kTimeS);
    const double deviations = std::abs(fit->terms[0].share - kShare) / fit->share_sigmas[0];
    within_one += deviations < 1 ? 1 : 0;
    within_two += deviations < 2 ? 1 : 0;
  }
  // 68.3 and 95.4 % of 30 are 20.5 and 28.6; three standard deviations of the counts are 7.6 and 3.4.
  EXPECT_GE(within_one, 13);
  EXPECT_LE(within_one, 28);
  EXPECT_GE(within_two, 25);
}

TEST(RelaxationFitTest, FindsTwoTermsWhereTheyShow) {
  std::mt19937 random(5);
  const std::vector<RelaxationTerm> terms = {{0.04, 5}, {0.05, 60}};
  std::vector<RelaxationRecord> records;
  for (int i = 0; i < 4; ++i) records.push_back(HeldForce(terms, 0.5, 1, 0.002, random));
  const auto fit = FitRelaxation(records);
  ASSERT_TRUE(fit.ok()) << fit.error().message;
  ASSERT_EQ(fit->terms.size(), 2u);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(fit->terms[i].share, terms[i].share, 4 * fit->share_sigmas[i] + 0.002);
    EXPECT_NEAR(fit->terms[i].time_s, terms[i].time_s, 0.3 * terms[i].time_s);
  }
  EXPECT_THAT(fit->source, HasSubstr("4 records of held forces"));
}

TEST(RelaxationFitTest, SaysWhatRecordsDoNotTell) {
  std::mt19937 random(7);
  const RelaxationRecord elastic[] = {HeldForce({}, 0.5, 1, 0.01, random)};
  const auto none = FitRelaxation(elastic);
  ASSERT_FALSE(none.ok());
  EXPECT_EQ(none.error().code, ErrorCode::kFailedPrecondition);
  RelaxationRecord backwards[] = {elastic[0]};
  backwards[0].samples[5].time_s = 0;
  EXPECT_THAT(FitRelaxation(backwards).error().message, HasSubstr("held: the times do not rise at sample 6"));
  RelaxationRecord infinite[] = {elastic[0]};
  infinite[0].samples[5].apparent_n = NAN;
  EXPECT_THAT(FitRelaxation(infinite).error().message, HasSubstr("sample 6 is not finite"));
  RelaxationRecord untouched[] = {elastic[0]};
  for (auto& sample : untouched[0].samples) sample.reference_n = 0;
  EXPECT_THAT(FitRelaxation(untouched).error().message, HasSubstr("nothing presses"));
  EXPECT_THAT(FitRelaxation({}).error().message, HasSubstr("0 samples of a held force are too few"));
  RelaxationRecord empty[] = {RelaxationRecord{.name = "e"}, elastic[0]};
  EXPECT_THAT(FitRelaxation(empty).error().message, HasSubstr("e: the reference force is never above 0"));
}

}  // namespace
}  // namespace taclink
