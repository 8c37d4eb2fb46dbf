#include "sensing/markers/label/path_tracker.h"

#include <gtest/gtest.h>

#include "sensing/model/model_file.h"
#include "tests/support/inflated_skin.h"
#include "tests/support/synthetic_markers.h"

namespace taclink {
namespace {

/// What air under pressure does to the skin, by its rings, between which it is linear.
class Swelling {
 public:
  Swelling(const LinkModel& model, double pressure_mpa) {
    const std::vector<Vec3> moved = InflatedMarkers(model, model.material, pressure_mpa, 2);
    z_mm_ = {0};
    outward_axial_mm_ = {Vec2::Zero()};
    for (int ring = 0; ring < model.markers.rings(); ++ring) {
      const int marker = model.MarkerIndex(0, ring);
      const Vec3 rest = model.RestMarker(marker), by = moved[static_cast<size_t>(marker)];
      z_mm_.push_back(rest.z());
      outward_axial_mm_.emplace_back(by.head<2>().dot(rest.head<2>().normalized()), by.z());
    }
    z_mm_.push_back(model.length_mm);
    outward_axial_mm_.emplace_back(Vec2::Zero());
  }

  Vec3 Of(const Vec3& at) const {
    const auto above = std::upper_bound(z_mm_.begin() + 1, z_mm_.end() - 1, at.z());
    const auto k = static_cast<size_t>(above - z_mm_.begin());
    const double share = (at.z() - z_mm_[k - 1]) / (z_mm_[k] - z_mm_[k - 1]);
    const Vec2 by = (1 - share) * outward_axial_mm_[k - 1] + share * outward_axial_mm_[k];
    Vec3 moved = at + by.y() * Vec3::UnitZ();
    moved.head<2>() += by.x() * at.head<2>().normalized();
    return moved;
  }

 private:
  std::vector<double> z_mm_;
  std::vector<Vec2> outward_axial_mm_;
};

class PathTrackerTest : public ::testing::TestWithParam<std::string> {
 protected:
  LabelScore Run(double depth_mm, int dents, const SyntheticOptions& options, int trials,
                 double pressure_mpa = 0) {
    const Swelling swelling(model_, pressure_mpa);
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
      const auto motion = [&](const Vec3& rest) { return swelling.Of(Deform(model_, where, rest)); };
      const auto view = SeeMoved(model_, model_.nominal_rig, motion, options, random);
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

// Paths whose first rings leave the pictures may be numbered a ring off in both cameras.
TEST_P(PathTrackerTest, NoWrongLabelOnAnInflatedSkin) {
  for (const double kpa : {0.5, 1.0, 1.5}) {
    for (const double depth : {0.0, 3.0, 6.0}) {
      const LabelScore score = Run(depth, 1, {.noise_px = 0.1}, 20, 1e-3 * kpa);
      EXPECT_EQ(score.wrong, 0) << kpa << " kPa, " << depth << " mm";
      EXPECT_GE(score.right, 0.98 * score.shown) << kpa << " kPa, " << depth << " mm";
    }
  }
}

// Half of the skin pressed, half as it was; with a path that both cameras miss. The paths are equals: turned
// by one, the same is labelled.
TEST_P(PathTrackerTest, HalfOfAnInflatedSkinPressed) {
  const Swelling swelling(model_, 1.5e-3);
  const int paths = model_.markers.paths;
  std::vector<int> right;
  for (const int turned : {0, 1, 5}) {
    std::vector<Dent> where;
    for (int l = 0; l < paths / 2; ++l)
      where.push_back({model_.PathAngle((l + turned) % paths), model_.length_mm / 2, 2.5, 22});
    const auto motion = [&](const Vec3& rest) { return swelling.Of(Deform(model_, where, rest)); };
    std::mt19937 random(3);
    // The picture's corners see more than its edges: a camera that is as wide everywhere.
    StereoRig rig = model_.nominal_rig;
    for (const CameraId id : kBothCameras) {
      rig[id].width_px += 200;
      rig[id].height_px = rig[id].width_px;
      rig[id].lens.principal_point_px = Vec2::Constant(rig[id].width_px / 2.0);
    }
    auto view = SeeMoved(model_, rig, motion, {.noise_px = 0}, random);
    for (size_t c = 0; c < kCameraCount; ++c) {
      for (size_t k = view.markers[c].size(); k-- > 0;) {
        const int path = view.markers[c][k] % paths, ring = view.markers[c][k] / paths;
        const bool is_outside =
            (path + 2 * paths - turned) % 4 == 0 && (ring == 0 || ring + 1 == model_.markers.rings());
        if (path != (3 + turned) % paths && !is_outside) continue;
        view.markers[c].erase(view.markers[c].begin() + static_cast<std::ptrdiff_t>(k));
        view.detections[c].erase(view.detections[c].begin() + static_cast<std::ptrdiff_t>(k));
      }
    }
    PathTracker tracker(model_, rig);
    LabelledMarkers labels;
    tracker.Label(view.detections, labels);
    const LabelScore score = Score(view, labels);
    EXPECT_EQ(score.wrong, 0) << turned;
    EXPECT_GE(score.right, 0.65 * score.shown) << turned;
    right.push_back(score.right);
  }
  EXPECT_EQ(right[1], right[0]);
  EXPECT_EQ(right[2], right[0]);
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

INSTANTIATE_TEST_SUITE_P(ShippedModels, PathTrackerTest, ::testing::Values("cylinder", "barrel"));

}  // namespace
}  // namespace taclink
