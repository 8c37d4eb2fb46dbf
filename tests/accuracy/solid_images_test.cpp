// The whole way from images to forces against three-dimensional solids, those that were kept out of tuning.
#include "tests/accuracy/solid_images.h"

#include <gtest/gtest.h>

#include <cstdio>

namespace taclink {
namespace {

constexpr double kLeastThatHold = 0.85, kMostSilent = 0.05;
constexpr double kRmsMm = 0.15, kWorstMm = 3;

TEST(SolidImages, HeldOutScenesHold) {
  std::vector<AccuracyRow> rows;
  int near = 0, close = 0;
  for (const SolidScene& scene : ReadSolidScenes()) {
    if (!scene.held_out) continue;
    rows.push_back(SolveSolidImages(scene));
    const AccuracyRow& row = rows.back();
    if (!row.fault.empty())
      std::printf("  %s: %s; %s\n", row.scene.c_str(), row.fault.c_str(), row.is_ok ? "ok" : "reported");
    near += row.is_ok && row.shape_rms_mm <= kRmsMm;
    close += row.is_ok && row.shape_worst_mm <= kWorstMm;
  }
  const AccuracyShares shares = SharesOf(rows);
  std::printf(
      "%d scenes, %d hold, %d are silently wrong; of %d that are ok, %d are within %.2f mm RMS, %d within "
      "%.0f mm\n",
      shares.rows, shares.holds, shares.silent, shares.ok, near, kRmsMm, close, kWorstMm);
  ASSERT_GT(shares.rows, 0) << "tests/accuracy/calculix has no scenes";
  EXPECT_GE(shares.Holds(), kLeastThatHold);
  EXPECT_LE(shares.Silent(), kMostSilent);
  EXPECT_GE(close, 0.95 * shares.ok);
}

}  // namespace
}  // namespace taclink
