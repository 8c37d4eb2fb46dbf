#include "sensing/markers/path_tracker.h"

#include <gtest/gtest.h>

#include "sensing/model/model_file.h"
#include "tests/support/synthetic_markers.h"

namespace taclink {
namespace {

class PathTrackerTest : public testing::TestWithParam<std::string> {
 protected:
  LabelScore Run(double depth_mm, int dents, const SyntheticOptions& options, int trials) {
    PathTracker tracker(model_, model_.nominal_rig);
    std::mt19937 random(11);
    std::uniform_real_distribution<double> uniform(0, 1);
    LabelScore total;
    LabelledMarkers labels;
    for (int trial = 0; trial < trials; ++trial) {
      std::vector<Dent> where;
      for (int i = 0; i < dents; ++i) {
        where.push_back(
            {2 * kPi * uniform(random), model_.length_mm * (0.15 + 0.7 * uniform(random)), depth_mm, 25});
      }
      const auto view = See(model_, model_.nominal_rig, where, options, random);
      tracker.Label(view.detections, labels);
      const LabelScore score = Score(view, labels);
      total.shown += score.shown;
      total.right += score.right;
      total.wrong += score.wrong;
    }
    return total;
  }

  LinkModel model_ = LoadLinkModel(GetParam()).value();
};

TEST_P(PathTrackerTest, AtRestAllLabelsAreRight) {
  const LabelScore score = Run(0, 0, {.noise_px = 0.1}, 3);
  EXPECT_EQ(score.wrong, 0);
  EXPECT_EQ(score.right, score.shown);
}

TEST_P(PathTrackerTest, NoWrongLabelInDentsAndBulges) {
  for (const double depth : {4.0, 8.0, 10.0, -6.0}) {
    const LabelScore score = Run(depth, 1, {.noise_px = 0.1}, 40);
    EXPECT_EQ(score.wrong, 0) << depth;
    EXPECT_GE(score.right, 0.94 * score.shown) << depth;
  }
}

TEST_P(PathTrackerTest, HardlyAWrongLabelInThreeDeepDents) {
  const LabelScore score = Run(15, 3, {.noise_px = 0.3, .drop = 0.02}, 60);
  EXPECT_LE(score.wrong, 1);
  EXPECT_GE(score.right, 0.62 * score.shown);
}

TEST_P(PathTrackerTest, MissingMarkersShiftNoLabel) {
  const LabelScore score = Run(6, 1, {.noise_px = 0.2, .drop = 0.06}, 40);
  EXPECT_EQ(score.wrong, 0);
  EXPECT_GE(score.right, 0.92 * score.shown);
}

TEST_P(PathTrackerTest, FalseSpotsAreLeftOut) {
  // A false spot of the right size within a millimetre of a marker can't be told from it; 240 spots in all.
  const LabelScore score = Run(5, 1, {.noise_px = 0.2, .false_spots = 6}, 40);
  EXPECT_LE(score.wrong, 2);
  EXPECT_GE(score.right, 0.97 * score.shown);
}

TEST_P(PathTrackerTest, OneCameraGoneKeepsTheNearOnesOfTheOther) {
  PathTracker tracker(model_, model_.nominal_rig);
  std::mt19937 random(2);
  auto view = See(model_, model_.nominal_rig, {}, {.noise_px = 0.1}, random);
  view.detections[1].clear();
  view.markers[1].clear();
  LabelledMarkers labels;
  tracker.Label(view.detections, labels);
  const LabelScore score = Score(view, labels);
  EXPECT_EQ(score.wrong, 0);
  EXPECT_GE(score.right, 0.8 * score.shown);
}

TEST_P(PathTrackerTest, NothingSeenIsNothingLabelled) {
  PathTracker tracker(model_, model_.nominal_rig);
  LabelledMarkers labels;
  tracker.Label({}, labels);
  for (const auto& camera : labels.cameras) {
    ASSERT_EQ(static_cast<int>(camera.size()), model_.markers.count());
    for (const MarkerObservation& o : camera) EXPECT_FALSE(o.seen);
  }
}

INSTANTIATE_TEST_SUITE_P(ShippedModels, PathTrackerTest, testing::Values("cylinder", "barrel"));

}  // namespace
}  // namespace taclink
