// The estimator against three-dimensional solids that another program solved, from their markers. CI
// recomputes the scenes that no constant was chosen by and asserts hard limits; report.csv has all scenes
// (deploy/accuracy).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

#include "tests/accuracy/solid_judge.h"
#include "tests/accuracy/solid_markers.h"

namespace taclink {
namespace {

constexpr double kLeastThatHold = 0.85, kMostSilent = 0.05;  // of all; of one condition:
constexpr double kLeastOfCondition = 0.75, kMostSilentOfCondition = 0.1;

TEST(Solids, HeldOutScenesHold) {
  const LinkModel model = SolidSkin();
  StateEstimator estimator(model, {});
  std::vector<AccuracyRow> rows;
  for (const MarkerCondition& condition : kMarkerConditions) {
    std::vector<AccuracyRow> of_condition;
    double rms_mm = 0, worst_mm = 0;
    for (const SolidScene& scene : ReadSolidScenes()) {
      if (!scene.held_out) continue;
      of_condition.push_back(SolveSolidMarkers(scene, condition, estimator));
      const AccuracyRow& row = of_condition.back();
      if (!row.fault.empty())
        std::printf("  %s, %s: %s; %s\n", row.scene.c_str(), condition.name, row.fault.c_str(),
                    row.is_ok ? "ok" : "reported");
      rms_mm = std::max(rms_mm, row.shape_rms_mm);
      worst_mm = std::max(worst_mm, row.shape_worst_mm);
    }
    std::printf("%s: markers of scenes that are ok are at most %.3f mm RMS and %.2f mm off\n", condition.name,
                rms_mm, worst_mm);
    EXPECT_LE(rms_mm, 0.3) << condition.name;
    EXPECT_LE(worst_mm, 4) << condition.name;
    EXPECT_GE(SharesOf(of_condition).Holds(), kLeastOfCondition) << condition.name;
    EXPECT_LE(SharesOf(of_condition).Silent(), kMostSilentOfCondition) << condition.name;
    rows.insert(rows.end(), of_condition.begin(), of_condition.end());
  }
  const AccuracyShares shares = SharesOf(rows);
  int forces = 0, within = 0;
  for (const AccuracyRow& row : rows) {
    forces += row.forces;
    within += row.within_2_sigma;
  }
  std::printf("%d of %d forces are within 2 sigma\n", within, forces);
  EXPECT_GE(forces, 200);
  EXPECT_GE(within, 0.9 * forces);
  std::printf("%d rows, %d hold, %d are silently wrong\n", shares.rows, shares.holds, shares.silent);
  ASSERT_GE(shares.rows, 200) << "tests/accuracy/calculix has no scenes";
  EXPECT_GE(shares.Holds(), kLeastThatHold);
  EXPECT_LE(shares.Silent(), kMostSilent);
}

TEST(Solids, AnUntouchedSkinHasNoContact) {
  const LinkModel model = SolidSkin();
  StateEstimator estimator(model, {});
  SolidScene rest = ReadSolidScenes().front();
  rest.contacts.clear();
  rest.markers_mm = rest.baseline_mm;
  rest.pressure_kpa = rest.baseline_kpa;
  for (const char* name : {"a", "b", "c", "d", "e"}) {
    const MarkerInput input = MakeMarkerInput(rest, {name, 0.1, 0.1});
    const LinkState state = SolveMarkers(model, estimator, input.loads, input.shape);
    EXPECT_EQ(state.status, LinkStatus::kOk) << state.status_reason;
    EXPECT_TRUE(state.contacts.empty()) << name;
  }
}

// What presses alike all around is one contact without a resultant.
TEST(SolidsTest, AHugIsOneContact) {
  const LinkModel model = SolidSkin();
  StateEstimator estimator(model, {});
  int hugs = 0;
  for (const SolidScene& scene : ReadSolidScenes()) {
    if (scene.contacts.size() != 1) continue;
    const SolidContact& truth = scene.contacts.front();
    if (truth.force_n.norm() > 0.01 * truth.normal_force_n) continue;
    ++hugs;
    for (const MarkerCondition& how : {MarkerCondition{"exact"}, MarkerCondition{"hug", 0.1}}) {
      SCOPED_TRACE(scene.name + " " + how.name);
      const MarkerInput shown = MakeMarkerInput(scene, how);
      const LinkState state = SolveMarkers(model, estimator, shown.loads, shown.shape);
      ASSERT_EQ(state.contacts.size(), 1u);
      const Contact& contact = state.contacts.front();
      EXPECT_TRUE(contact.is_ring_contact);
      EXPECT_NEAR(contact.normal_force_n, truth.normal_force_n, 0.12 * truth.normal_force_n);
      EXPECT_LT(contact.force_n.norm(), 0.05 * truth.normal_force_n);
      EXPECT_LT((contact.center_mm - truth.center_mm).norm(), 4);
    }
  }
  EXPECT_GE(hugs, 6);
}

// Whatever was shown before, the same markers give the same forces: scenes in random order, every third with
// most of its markers gone, against an estimator that knows nothing.
TEST(SolidsTest, ColdIsWarm) {
  const std::vector<SolidScene> scenes = ReadSolidScenes();
  ASSERT_FALSE(scenes.empty());
  std::mt19937 random(7);
  const LinkModel model = SolidSkin();
  StateEstimator warm(model, {}), cold(model, {});
  int compared = 0, alike = 0;
  for (int frame = 0; frame < 60; ++frame) {
    const SolidScene& scene = scenes[random() % scenes.size()];
    const bool blind = frame % 3 == 1;
    const MarkerInput shown = MakeMarkerInput(scene, {"walk", 0.1, blind ? 0.7 : 0.0});
    const LinkState with = SolveMarkers(model, warm, shown.loads, shown.shape);
    if (blind) continue;
    cold.Restart();
    const LinkState without = SolveMarkers(model, cold, shown.loads, shown.shape);
    if (!without.forces.converged) continue;
    ++compared;
    bool same = with.forces.converged && with.contacts.size() == without.contacts.size();
    for (size_t i = 0; same && i < with.contacts.size(); ++i) {
      double nearest = 1e9;
      const Contact& a = with.contacts[i];
      for (const Contact& b : without.contacts) nearest = std::min(nearest, (a.force_n - b.force_n).norm());
      same = a.force_covariance_n2 && nearest < 0.2 * std::sqrt(a.force_covariance_n2->trace());
    }
    alike += same;
    if (!same) std::printf("  %s differs from what was before\n", scene.name.c_str());
  }
  std::printf("%d of %d alike\n", alike, compared);
  EXPECT_GE(compared, 30);
  EXPECT_GE(alike, 0.9 * compared);
}

}  // namespace
}  // namespace taclink
