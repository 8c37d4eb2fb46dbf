#include "sensing/acceptance/acceptance_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "sensing/acceptance/acceptance_plan.h"
#include "sensing/acceptance/report_html.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

using testing::HasSubstr;

/// What is wrong with a made-up link. Everything random is normal with these standard deviations.
struct Flaws {
  double scale = 0, slope_per_kpa = 0, turn_rad = 0, creep = 0, gain = 0, ghost_n = 0;
  double place_sigma = 0.02, load_sigma = 0.01, slope_sigma = 0.01, place_sigma_mm = 0.8;
  double sensor_sigma_kpa = 0.003;
};

TrialReading Reading(double force_n, const Vec3& center_mm, int64_t utc_ns) {
  TrialReading reading;
  reading.frames = reading.usable = 30;
  reading.has_contact = force_n > 0;
  reading.force_n = force_n;
  reading.center_mm = center_mm;
  reading.total_force_n = -force_n * Vec3(center_mm.x(), center_mm.y(), 0).stableNormalized();
  reading.utc_ns = utc_ns;
  return reading;
}

/// A record of the shipped plan as a link with these flaws would have made it. The errors are drawn here and
/// share nothing with the analysis.
AcceptanceRecord RecordOf(const std::string& plan_name, const Flaws& flaws, uint32_t seed) {
  const auto model = LoadLinkModel("cylinder");
  const auto plan = LoadAcceptancePlan(plan_name);
  AcceptanceRecord record{
      .link = "made_up", .plan = plan->name, .model = model->name, .limits = plan->limits};
  record.limits.force_floor_n = 0.01;
  record.trials = *MakeTrials(*plan, *model);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<std::array<double, 3>> places(1024);  // force, slope and angle errors by marker
  for (auto& place : places)
    place = {flaws.place_sigma * normal(random), flaws.slope_sigma * normal(random),
             flaws.place_sigma_mm * normal(random)};
  for (AcceptanceTrial& trial : record.trials) {
    const int64_t utc_ns = int64_t{60'000'000'000} * trial.id;
    const double kpa = trial.pressure_mpa.value_or(0) * 1e3;
    trial.state = TrialState::kMeasured;
    Vec3 center = Vec3::Zero();
    double force_n = 0;
    if (trial.path > 0) {
      const int marker = model->MarkerIndex(trial.path - 1, trial.ring - 1);
      const auto& place = places[static_cast<size_t>(marker)];
      const double angle = model->PathAngle(trial.path - 1),
                   z = model->markers.rings_z_mm[static_cast<size_t>(trial.ring - 1)];
      trial.reference.place_mm = model->PointAtDepth(angle, z, 0);
      center = model->PointAtDepth(angle + flaws.turn_rad + place[2] / 40,
                                   z + flaws.place_sigma_mm * normal(random), 5);
      const double error = flaws.scale + place[0] + (flaws.slope_per_kpa + place[1]) * kpa;
      force_n = *trial.force_n * (1 + error + flaws.load_sigma * normal(random));
      trial.released = Reading(std::abs(flaws.ghost_n * normal(random)), center, utc_ns + 20'000'000'000);
    }
    trial.loaded = Reading(force_n, center, utc_ns);
    if (trial.kind == TrialKind::kHold) {
      for (int s = 0; s < 60; ++s)
        trial.loaded->held.push_back(
            {s + 0.5, force_n * (1 + flaws.creep * (s - 1) / 57.0 + 0.002 * normal(random))});
    }
    trial.reference.pressure_mpa = 1e-3 * kpa;
    trial.loaded->pressure_mpa = 1e-3 * (kpa * (1 + flaws.gain) + flaws.sensor_sigma_kpa * normal(random));
  }
  return record;
}

bool Holds(const AcceptanceReport& report, const std::string& id, double truth) {
  const AcceptanceQuantity* quantity = report.Quantity(id);
  return quantity && quantity->low && *quantity->low <= truth && truth <= *quantity->high;
}

bool Finds(const AcceptanceReport& report, FindingId id) {
  return std::ranges::any_of(report.findings, [&](const auto& finding) { return finding.id == id; });
}

TEST(AcceptanceReport, IntervalsHoldTheTruthAndFlawsAreFound) {
  constexpr int kLinks = 200;
  struct Count {
    int bias = 0, slope = 0, turn = 0, creep = 0, gain = 0;
  } held, found, alarms;
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  for (uint32_t link = 0; link < kLinks; ++link) {
    const Flaws flaws{.scale = 0.1 + 0.01 * normal(random),
                      .slope_per_kpa = -0.08,
                      .turn_rad = 5 * kPi / 180,
                      .creep = 0.08,
                      .gain = 0.05};
    const AcceptanceReport report = AnalyzeAcceptance(RecordOf("full", flaws, link));
    // Over the plan's loads: half of them under pressure, and the holds.
    const double mean_kpa = 0.5;
    held.bias += Holds(report, "force_bias", 100 * (flaws.scale + flaws.slope_per_kpa * mean_kpa)) ? 1 : 0;
    held.slope += Holds(report, "pressure_slope", 100 * flaws.slope_per_kpa) ? 1 : 0;
    held.turn += Holds(report, "turn_z", 5) ? 1 : 0;
    held.creep += Holds(report, "creep", 8) ? 1 : 0;
    held.gain += Holds(report, "pressure_gain", 5) ? 1 : 0;
    found.bias += Finds(report, FindingId::kForceScale) ? 1 : 0;
    found.slope += Finds(report, FindingId::kPressureEffect) ? 1 : 0;
    found.turn += Finds(report, FindingId::kMounting) ? 1 : 0;
    found.creep += Finds(report, FindingId::kCreep) ? 1 : 0;
    found.gain += Finds(report, FindingId::kPressureSensor) ? 1 : 0;
    const AcceptanceReport good = AnalyzeAcceptance(RecordOf("full", Flaws{}, link + kLinks));
    alarms.bias += good.findings.empty() ? 0 : 1;
  }
  EXPECT_GE(held.slope, 0.93 * kLinks);
  EXPECT_GE(held.turn, 0.93 * kLinks);
  EXPECT_GE(held.creep, 0.93 * kLinks);
  EXPECT_GE(held.gain, 0.93 * kLinks);
  EXPECT_GE(held.bias, 0.90 * kLinks);  // the holds are at two places and without pressure
  for (const int count : {found.bias, found.slope, found.turn, found.creep, found.gain})
    EXPECT_GE(count, 0.95 * kLinks);
  EXPECT_LE(alarms.bias, 0.05 * kLinks);
}

TEST(AcceptanceReport, QuickPlanFindsAFactorAndPassesAGoodLink) {
  const AcceptanceReport wrong = AnalyzeAcceptance(RecordOf("quick", {.scale = 0.2}, 5));
  EXPECT_EQ(wrong.verdict, Verdict::kFailed);
  EXPECT_TRUE(Finds(wrong, FindingId::kForceScale));
  EXPECT_THAT(wrong.findings[0].text, HasSubstr("calibrate material"));
  const AcceptanceReport good =
      AnalyzeAcceptance(RecordOf("quick", {.place_sigma = 0.01, .load_sigma = 0.005}, 6));
  EXPECT_EQ(good.verdict, Verdict::kPassed);
  EXPECT_TRUE(good.findings.empty());
  EXPECT_EQ(good.Quantity("pressure_slope")->verdict, Verdict::kNotMeasured);
}

TEST(AcceptanceReport, LoadsThatTheLinkDidNotMeasureFailIt) {
  AcceptanceRecord record = RecordOf("quick", {}, 1);
  record.trials[2].loaded->usable = 3;
  record.trials[2].loaded->reasons = {{ReasonId::kCamerasMoved, 27, "the cameras moved by 0.4 mm"}};
  const AcceptanceReport report = AnalyzeAcceptance(record);
  EXPECT_EQ(report.withheld, 1);
  EXPECT_EQ(report.verdict, Verdict::kFailed);
  EXPECT_TRUE(Finds(report, FindingId::kWithheld));
  record.trials[3].loaded = Reading(0, Vec3::Zero(), 0);  // usable, but nothing was found
  EXPECT_EQ(AnalyzeAcceptance(record).loads[2].force, -1);
}

// A skin that creeps by one term: the report has it for the model file, with its standard deviation.
TEST(AcceptanceReport, HoldsGiveTheModelsRelaxation) {
  AcceptanceRecord record = RecordOf("quick", {}, 4);
  std::mt19937 random(9);
  std::normal_distribution<double> normal;
  constexpr double kShare = 0.1, kTimeS = 8;
  for (AcceptanceTrial& trial : record.trials) {
    if (trial.kind != TrialKind::kHold) continue;
    const double force_n = *trial.force_n;
    // The elastic force of a constant load grows by the compliance of one term [fung1993].
    for (HeldSample& sample : trial.loaded->held) {
      const double creep = (1 - kShare * std::exp(-sample.time_s * (1 - kShare) / kTimeS)) / (1 - kShare);
      sample.force_n = force_n * (creep + 0.0005 * normal(random));
    }
  }
  const AcceptanceReport report = AnalyzeAcceptance(record);
  const auto creep = std::ranges::find(report.findings, FindingId::kCreep, &AcceptanceFinding::id);
  ASSERT_NE(creep, report.findings.end());
  const size_t at = creep->text.find("shares: [");
  ASSERT_NE(at, std::string::npos) << creep->text;
  EXPECT_NEAR(std::stod(creep->text.substr(at + 9)), kShare, 0.02) << creep->text;
  EXPECT_NEAR(std::stod(creep->text.substr(creep->text.find("times_s: [") + 10)), kTimeS, 2) << creep->text;
}

// The plan asks for a hold; without one its limit is not decided.
TEST(AcceptanceReport, WhatWasPlannedAndSkippedIsUndecided) {
  AcceptanceRecord record = RecordOf("quick", {.place_sigma = 0.01, .load_sigma = 0.005}, 6);
  for (AcceptanceTrial& trial : record.trials)
    if (trial.kind == TrialKind::kHold) trial.state = TrialState::kSkipped;
  const AcceptanceReport report = AnalyzeAcceptance(record);
  EXPECT_EQ(report.Quantity("creep")->verdict, Verdict::kNotMeasured);
  EXPECT_EQ(report.verdict, Verdict::kUndecided);
}

TEST(AcceptanceReport, AnUncertainReferenceDecidesLess) {
  AcceptanceRecord record = RecordOf("quick", {.place_sigma = 0.01, .load_sigma = 0.005}, 6);
  for (AcceptanceTrial& trial : record.trials)
    trial.reference.force_sigma_n = 0.1 * trial.force_n.value_or(0);
  const AcceptanceReport report = AnalyzeAcceptance(record);
  const AcceptanceQuantity* bias = report.Quantity("force_bias");
  EXPECT_GT(*bias->high - *bias->low, 2 * 19);  // percent: 1.96 times 10 to either side
  EXPECT_EQ(bias->verdict, Verdict::kUndecided);
}

TEST(AcceptanceReport, ForcesOfAnInflatedSkinThatNothingTouchesAreAFinding) {
  AcceptanceRecord record = RecordOf("full", {}, 1);
  for (AcceptanceTrial& trial : record.trials)
    if (trial.kind == TrialKind::kPressure) trial.loaded->force_n = 0.5;
  EXPECT_TRUE(Finds(AnalyzeAcceptance(record), FindingId::kPhantom));
}

// A tare in between sets the drift back: that is no drift.
TEST(AcceptanceReport, DriftIsTakenWithinABaseline) {
  AcceptanceRecord record = RecordOf("quick", {}, 1);
  const size_t half = record.trials.size() / 2;
  for (size_t i = 0; i < record.trials.size(); ++i) {
    AcceptanceTrial& trial = record.trials[i];
    trial.released.reset();
    trial.loaded->baseline_utc_ns = i < half ? 1 : 2;
    trial.loaded->baseline_drift_mm = 0.02 * static_cast<double>(i < half ? i : i - half);
  }
  const AcceptanceReport report = AnalyzeAcceptance(record);
  EXPECT_NEAR(report.Quantity("drift")->value, 1.2, 1e-6);  // mm/h: 0.02 mm a minute
}

TEST(AcceptanceReport, WhatTheLinkItselfReportsIsAFinding) {
  AcceptanceRecord record = RecordOf("quick", {}, 1);
  for (AcceptanceTrial& trial : record.trials)
    trial.loaded->reasons = {{ReasonId::kCamerasMoved, 30, "the cameras moved by 0.4 mm"}};
  const AcceptanceReport report = AnalyzeAcceptance(record);
  ASSERT_TRUE(Finds(report, FindingId::kCamera));
  EXPECT_THAT(report.findings[0].text, HasSubstr("0.4 mm"));
}

TEST(AcceptanceReport, UnfinishedIsUndecidedAndEmptyIsNotMeasured) {
  AcceptanceRecord record = RecordOf("quick", {.place_sigma = 0.01, .load_sigma = 0.005}, 6);
  record.trials.back().state = TrialState::kOpen;
  record.trials.back().loaded.reset();
  EXPECT_EQ(AnalyzeAcceptance(record).verdict, Verdict::kUndecided);
  for (AcceptanceTrial& trial : record.trials) trial = AcceptanceTrial{.id = trial.id};
  const AcceptanceReport report = AnalyzeAcceptance(record);
  EXPECT_EQ(report.verdict, Verdict::kNotMeasured);
  EXPECT_THAT(AcceptanceHtml(record, report), HasSubstr("not measured"));
}

TEST(AcceptanceReport, PageAndTableHaveEveryTrialAndEscapeNames) {
  AcceptanceRecord record = RecordOf("quick", {}, 1);
  record.link = "<b>&\"";
  record.trials[0].attitude = "a,b";
  const AcceptanceReport report = AnalyzeAcceptance(record);
  const std::string page = AcceptanceHtml(record, report), csv = AcceptanceCsv(record, report);
  EXPECT_THAT(page, HasSubstr("&lt;b&gt;&amp;&quot;"));
  EXPECT_EQ(page.find("<b>&\""), std::string::npos);
  EXPECT_EQ(page.find("http"), std::string::npos);
  EXPECT_EQ(std::ranges::count(csv, '\n'), 12);
  const auto columns = std::ranges::count(csv.substr(0, csv.find('\n')), ',');
  for (size_t begin = 0, end = 0; (end = csv.find('\n', begin)) != std::string::npos; begin = end + 1)
    EXPECT_EQ(std::ranges::count(csv.substr(begin, end - begin), ','), columns);
}

}  // namespace
}  // namespace taclink
