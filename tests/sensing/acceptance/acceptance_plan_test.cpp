#include "sensing/acceptance/acceptance_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "sensing/model/model_file.h"

namespace taclink {
namespace {

using testing::HasSubstr;

std::vector<AcceptanceTrial> TrialsOf(const std::string& plan_name, const std::string& model_name) {
  const auto plan = LoadAcceptancePlan(plan_name);
  EXPECT_TRUE(plan.ok());
  const auto model = LoadLinkModel(model_name);
  EXPECT_TRUE(model.ok());
  const auto trials = MakeTrials(*plan, *model);
  EXPECT_TRUE(trials.ok());
  return trials.ok() ? *trials : std::vector<AcceptanceTrial>();
}

std::string Refusal(const std::string& text) {
  const auto plan = ParseAcceptancePlan("p.yaml", text);
  return plan.ok() ? "accepted" : plan.error().message;
}

TEST(AcceptancePlan, ShippedPlansFitEveryShippedModel) {
  for (const std::string& plan : ShippedPlanNames()) {
    for (const std::string& model : ShippedModelNames()) EXPECT_GT(TrialsOf(plan, model).size(), 5u) << model;
  }
}

TEST(AcceptancePlan, QuickHasFivePlacesTwiceAndOneHoldAtTheEnd) {
  const auto trials = TrialsOf("quick", "cylinder");
  ASSERT_EQ(trials.size(), 11u);
  std::set<std::pair<int, int>> places;
  for (size_t i = 0; i < trials.size(); ++i) {
    EXPECT_EQ(trials[i].id, i + 1);
    EXPECT_EQ(trials[i].state, TrialState::kOpen);
    if (trials[i].kind == TrialKind::kLoad) places.insert({trials[i].path, trials[i].ring});
  }
  EXPECT_EQ(places.size(), 5u);
  EXPECT_EQ(trials.back().kind, TrialKind::kHold);
  EXPECT_EQ(trials.back().hold_s, 60);
}

TEST(AcceptancePlan, TrialsWithOnePressureFollowEachOtherAndTheOrderIsThatOfTheSeed) {
  const auto trials = TrialsOf("full", "cylinder");
  std::set<std::optional<double>> pressures;
  int changes = 1;
  for (size_t i = 0; i < trials.size(); ++i) {
    pressures.insert(trials[i].pressure_mpa);
    if (i > 0 && trials[i].pressure_mpa != trials[i - 1].pressure_mpa) ++changes;
  }
  EXPECT_EQ(changes, static_cast<int>(pressures.size()));
  const auto again = TrialsOf("full", "cylinder");
  auto plan = LoadAcceptancePlan("full");
  plan->seed = 2;
  const auto other = MakeTrials(*plan, *LoadLinkModel("cylinder"));
  ASSERT_TRUE(other.ok());
  bool is_same = true, is_other_same = true;
  for (size_t i = 0; i < trials.size(); ++i) {
    is_same = is_same && trials[i].path == again[i].path && trials[i].ring == again[i].ring;
    is_other_same = is_other_same && trials[i].path == (*other)[i].path && trials[i].ring == (*other)[i].ring;
  }
  EXPECT_TRUE(is_same);
  EXPECT_FALSE(is_other_same);
}

TEST(AcceptancePlan, BadPlansSayWhatAndWhere) {
  EXPECT_THAT(Refusal("taclink_acceptance: 2\nname: x\nseries: []\n"), HasSubstr("p.yaml:1"));
  EXPECT_THAT(Refusal("taclink_acceptance: 1\nname: x\nseries: []\n"), HasSubstr("series"));
  const std::string head = "taclink_acceptance: 1\nname: x\nseries:\n";
  EXPECT_THAT(Refusal(head + "  - {name: a}\n"), HasSubstr("force_n"));
  EXPECT_THAT(Refusal(head + "  - {name: a, force_n: -1}\n"), HasSubstr("p.yaml:4"));
  EXPECT_THAT(Refusal(head + "  - {name: a, force_n: 1, weight: 2}\n"), HasSubstr("weight"));
  EXPECT_THAT(Refusal(head + "  - {name: a, force_n: 1, markers: [3]}\n"), HasSubstr("pairs"));
  EXPECT_THAT(Refusal(head + "  - {name: a, pressure_kpa: 1, hold_s: 3}\n"), HasSubstr("hold_s"));
  EXPECT_EQ(Refusal(head + "  - {name: a, force_n: 1, markers: [3, 4]}\n"), "accepted");
  const auto missing = LoadAcceptancePlan("no-such-plan");
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(missing.error().message, HasSubstr("quick"));
}

TEST(AcceptancePlan, MarkersThatTheModelLacksAreNamed) {
  const auto plan = ParseAcceptancePlan(
      "p.yaml", "taclink_acceptance: 1\nname: x\nseries: [{name: a, force_n: 1, markers: [25, 4]}]\n");
  ASSERT_TRUE(plan.ok());
  const auto trials = MakeTrials(*plan, *LoadLinkModel("cylinder"));
  ASSERT_FALSE(trials.ok());
  EXPECT_THAT(trials.error().message, HasSubstr("(25, 4)"));
  EXPECT_THAT(trials.error().message, HasSubstr("1 to 24"));
}

}  // namespace
}  // namespace taclink
