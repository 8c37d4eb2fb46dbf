#include "bench/vision/vision_score.h"

#include <gtest/gtest.h>

#include <random>

#include "sensing/model/model_file.h"
#include "tests/support/drawn_vector.h"

namespace taclink {
namespace {

// A truth without pictures: markers far apart in both pictures, all seen.
class VisionScoreTest : public ::testing::Test {
 protected:
  VisionScoreTest() {
    truth_.positions_mm = model_.RestMarkers();
    truth_.displacements_mm.assign(count_, Vec3::Zero());
    for (size_t c = 0; c < kCameraCount; ++c) {
      result_.labels.cameras[c].resize(count_);
      for (size_t m = 0; m < count_; ++m) {
        const Vec2 pixel(20.0 * static_cast<double>(m % 24) + 20, 20.0 * static_cast<double>(m / 24) + 20);
        truth_.sights[c].push_back({true, true, pixel, 3});
        result_.labels.cameras[c][m].seen = true;
        result_.labels.cameras[c][m].center_px = pixel;
      }
    }
    result_.shape.positions_mm = truth_.positions_mm;
    result_.shape.displacements_mm = truth_.displacements_mm;
    result_.shape.sources.assign(count_, MarkerSource::kBoth);
    result_.status = LinkStatus::kOk;
  }
  MarkerObservation& Label(CameraId id, size_t marker) { return result_.labels.cameras[Index(id)][marker]; }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  const size_t count_ = static_cast<size_t>(model_.markers.count());
  VisionTruth truth_;
  VisionResult result_;
  VisionScorer scorer_{model_};
};

TEST_F(VisionScoreTest, APerfectMethodHasNoErrors) {
  for (int frame = 0; frame < 3; ++frame) scorer_.Add(truth_, result_);
  scorer_.Finish();
  const VisionScore& score = scorer_.score();
  EXPECT_EQ(score.frames, 3);
  EXPECT_EQ(score.measured, 3);
  EXPECT_EQ(score.position[2].count, 3 * static_cast<int64_t>(count_));
  EXPECT_EQ(score.position[2].Worst(ErrorAxis::k3d), 0);
  EXPECT_EQ(score.displacement[2].Rms(ErrorAxis::k3d), 0);
  EXPECT_EQ(score.systematic, 0);
  for (const LabelCounts& labels : score.labels) {
    EXPECT_EQ(labels.labelled, 3 * static_cast<int64_t>(count_));
    EXPECT_EQ(labels.wrong + labels.stray + labels.missing, 0);
  }
  EXPECT_TRUE(scorer_.incidents().labels.empty());
}

TEST_F(VisionScoreTest, SwappedStrayAndMissingLabelsAreCounted) {
  std::swap(Label(CameraId::kTop, 10).center_px, Label(CameraId::kTop, 11).center_px);
  Label(CameraId::kBottom, 5).center_px += Vec2(8, 7);
  Label(CameraId::kBottom, 6).seen = false;
  truth_.sights[1][7] = {};  // hidden, so its label is on nothing
  truth_.sights[1][8].whole = false;
  Label(CameraId::kBottom, 8).seen = false;  // cut off by the picture's edge: not missing
  scorer_.Add(truth_, result_);
  const LabelCounts &top = scorer_.score().labels[0], &bottom = scorer_.score().labels[1];
  EXPECT_EQ(top.wrong, 2);
  EXPECT_EQ(top.stray + top.missing, 0);
  EXPECT_EQ(bottom.wrong, 0);
  EXPECT_EQ(bottom.stray, 2);
  EXPECT_EQ(bottom.missing, 1);
  ASSERT_EQ(scorer_.incidents().labels.size(), 4U);
  EXPECT_EQ(scorer_.incidents().labels[0], "frame 0, top: (11, 1) is on (12, 1)");
}

TEST_F(VisionScoreTest, ErrorsFallOnTheirAxesAndClasses) {
  const size_t marker = 30;  // some angle
  const Vec2 out = truth_.positions_mm[marker].head<2>().normalized();
  result_.shape.positions_mm[marker] += Vec3(3 * out.x() - 2 * out.y(), 3 * out.y() + 2 * out.x(), -6);
  truth_.sights[0][marker].whole = false;
  scorer_.Add(truth_, result_);
  const ErrorSums& one = scorer_.score().position[1];
  ASSERT_EQ(one.count, 1);
  EXPECT_NEAR(one.Rms(ErrorAxis::kR), 3, 1e-9);
  EXPECT_NEAR(one.Rms(ErrorAxis::kPhiR), 2, 1e-9);
  EXPECT_NEAR(one.Worst(ErrorAxis::kZ), 6, 1e-9);
  EXPECT_NEAR(one.Rms(ErrorAxis::k3d), 7, 1e-9);
  EXPECT_EQ(scorer_.score().position[2].Rms(ErrorAxis::k3d), 0);
  EXPECT_EQ(scorer_.score().displacement[1].Rms(ErrorAxis::k3d), 0);
}

TEST_F(VisionScoreTest, GaussianErrorsOfTheSaidCovarianceAreConsistent) {
  std::mt19937_64 rng(3);
  std::normal_distribution<double> normal;
  Mat3 root;
  root << 0.1, 0, 0, 0.05, 0.2, 0, -0.1, 0.3, 0.4;
  const Vec3 bias(0.3, -0.2, 0.1);
  result_.shape.covariances_mm2.assign(count_, root * root.transpose());
  for (int frame = 0; frame < 60; ++frame) {
    for (size_t m = 0; m < count_; ++m) {
      const Vec3 noise = root * DrawnVec3([&] { return normal(rng); });
      result_.shape.displacements_mm[m] = truth_.displacements_mm[m] + noise;
      result_.shape.positions_mm[m] = truth_.positions_mm[m] + bias + noise;
    }
    scorer_.Add(truth_, result_);
  }
  scorer_.Finish();
  const VisionScore& score = scorer_.score();
  const Consistency c = ConsistencyOf(score.nees[static_cast<size_t>(MarkerSource::kBoth)]);
  EXPECT_EQ(c.count, 60 * static_cast<int64_t>(count_));
  EXPECT_NEAR(c.mean, 1, 0.03);
  EXPECT_NEAR(c.trimmed, 0.965, 0.03);
  EXPECT_NEAR(c.median, 0.789, 0.03);
  const auto n = static_cast<double>(score.split_count);
  EXPECT_NEAR(std::sqrt(score.systematic / n), bias.norm(), 0.01);
  EXPECT_NEAR(std::sqrt(score.random / n), std::sqrt((root * root.transpose()).trace()), 0.01);
}

TEST_F(VisionScoreTest, FramesWithoutAMeasurementCountAsSuch) {
  result_.shape = {};
  result_.status = LinkStatus::kLost;
  scorer_.Add(truth_, result_);
  EXPECT_EQ(scorer_.score().frames, 1);
  EXPECT_EQ(scorer_.score().measured, 0);
  EXPECT_EQ(scorer_.score().statuses[static_cast<size_t>(LinkStatus::kLost)], 1);
  EXPECT_EQ(scorer_.score().position[2].count, 0);
}

TEST(Percentile, OfFewSamples) {
  EXPECT_EQ(Percentile({}, 0.5), 0);
  EXPECT_EQ(Percentile({3, 1, 2}, 0.5), 2);
  EXPECT_EQ(Percentile({3, 1, 2}, 1), 3);
}

}  // namespace
}  // namespace taclink
