// Skins with weight in other attitudes than that of their baseline, against three-dimensional solids.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "tests/accuracy/solid_judge.h"
#include "tests/accuracy/solid_markers.h"

namespace taclink {
namespace {

double DegreesBetween(const Vec3& a, const Vec3& b) {
  return DegFromRad(std::atan2(a.cross(b).norm(), a.dot(b)));
}

// Forces must be as they should be, or the answer must not be called ok. `attitude`: of whether the
// baseline's and the frame's attitude are measured.
void Check(const MarkerCondition& condition, const char* attitude, double least_right, double most_deg) {
  constexpr double kTouchedShare = 1.5;  // a contact hides some of the skin's own shape
  StateEstimator estimator(SolidSkin(), {});
  int scenes = 0, right = 0, silent = 0;
  double worst_deg = 0;
  for (const SolidScene& scene : ReadWeightScenes()) {
    const AccuracyRow row = SolveSolidMarkers(scene, condition, estimator);
    const Vec3 found = estimator.estimate().known_loads.specific_force_mps2;
    const double off_deg =
        DegreesBetween(found, scene.specific_force_mps2) / (scene.contacts.empty() ? 1 : kTouchedShare);
    if (!row.fault.empty() || !row.is_ok || off_deg > most_deg)
      std::printf("  %s, %s: %s%s; specific force %.1f deg off, (%.2f, %.2f, %.2f) m/s^2\n",
                  scene.name.c_str(), condition.name, row.fault.empty() ? "right" : row.fault.c_str(),
                  row.is_ok ? "" : ", reported", off_deg, found.x(), found.y(), found.z());
    ++scenes;
    if (row.fault.empty() && row.is_ok) ++right;
    if (!row.fault.empty() && row.is_ok) ++silent;
    if (row.is_ok) worst_deg = std::max(worst_deg, off_deg);
  }
  std::printf(
      "%s, %s: %d of %d right, %d silently wrong; specific force at most %.1f deg off (touched: %.1f)\n",
      attitude, condition.name, right, scenes, silent, worst_deg, kTouchedShare * worst_deg);
  ASSERT_GE(scenes, 20) << "tests/accuracy/calculix has no solids with weight";
  EXPECT_GE(right, least_right * scenes);
  EXPECT_LE(silent, 0.05 * scenes);
  EXPECT_LE(worst_deg, most_deg);
}

TEST(WeightOfSolids, IsNoForceWhereTheAttitudeIsMeasured) {
  for (const double missing : {0.0, 0.2})
    Check({.name = "noise", .noise_mm = 0.1, .missing = missing}, "measured", 0.95, 2);
}

TEST(WeightOfSolids, IsNoForceWhereTheSkinAloneShowsTheAttitude) {
  for (const double missing : {0.0, 0.2})
    Check({.name = "noise", .noise_mm = 0.1, .missing = missing, .attitude = AttitudeMeasured::kOfBaseline},
          "measured of the baseline", 0.95, 5);
}

// The difference of two unknown attitudes shows; both of them hardly.
TEST(WeightOfSolids, IsNoForceWhereNoAttitudeIsKnown) {
  Check({.name = "noise", .noise_mm = 0.1, .attitude = AttitudeMeasured::kNever}, "unknown", 0.9, 180);
}

}  // namespace
}  // namespace taclink
