#include "sensing/estimation/unseen_markers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "sensing/model/model_file.h"

namespace taclink {
namespace {

class InterpolateUnseenTest : public ::testing::Test {
 protected:
  InterpolateUnseenTest() {
    observed_.information.assign(markers(), Mat3::Identity() / 0.0025);
    for (int m = 0; m < model_.markers.count(); ++m) {
      without_loads_mm_.segment<3>(3 * m) = Radial(m, 2);
      observed_.displacement_mm.push_back(Radial(m, -6 + 0.5 * model_.RingOf(m)));
    }
  }
  size_t markers() const { return static_cast<size_t>(model_.markers.count()); }
  Vec3 Radial(int marker, double mm) const {
    const double angle = 2 * std::numbers::pi * model_.PathOf(marker) / model_.markers.paths;
    return {mm * std::cos(angle), mm * std::sin(angle), 0};
  }
  void Hide(int path, int ring) {
    const auto m = static_cast<size_t>(model_.MarkerIndex(path, ring));
    observed_.information[m].setZero();
    observed_.displacement_mm[m].setConstant(std::nan(""));
  }
  void Interpolate(MarkerObservations& observed) const {
    InterpolateUnseen(model_, without_loads_mm_, 1, observed);
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  Eigen::VectorXd without_loads_mm_ = Eigen::VectorXd::Zero(3 * model_.markers.count());
  MarkerObservations observed_;
};

// A dent alike all around that varies linearly along the axis is harmonic.
TEST_F(InterpolateUnseenTest, ReproducesAHarmonicDent) {
  const MarkerObservations seen = observed_;
  for (const int ring : {2, 3, 4}) {
    for (int path = 22; path < 27; ++path) Hide(path % 24, ring);
  }
  MarkerObservations filled = observed_;
  Interpolate(filled);
  for (size_t m = 0; m < markers(); ++m)
    EXPECT_LT((filled.displacement_mm[m] - seen.displacement_mm[m]).norm(), 0.02) << m;
}

TEST_F(InterpolateUnseenTest, IsLessCertainFartherAway) {
  for (int ring = 0; ring < 3; ++ring) {
    for (int path = 0; path < 24; ++path) Hide(path, ring);
  }
  const MarkerObservations before = observed_;
  Interpolate(observed_);
  const auto trace = [&](int ring) {
    return observed_.information[static_cast<size_t>(model_.MarkerIndex(5, ring))].trace();
  };
  EXPECT_GT(trace(2), 0);
  EXPECT_NEAR(trace(1), trace(2) / 4, 1e-9);
  EXPECT_NEAR(trace(0), trace(2) / 9, 1e-9);
  for (size_t m = 0; m < markers(); ++m) {
    if (before.information[m].isZero()) continue;
    EXPECT_EQ(observed_.information[m], before.information[m]);
    EXPECT_EQ(observed_.displacement_mm[m], before.displacement_mm[m]);
  }
}

TEST_F(InterpolateUnseenTest, LeavesASkinThatNobodySees) {
  for (int ring = 0; ring < model_.markers.rings(); ++ring) {
    for (int path = 0; path < 24; ++path) Hide(path, ring);
  }
  Interpolate(observed_);
  for (const Mat3& information : observed_.information) EXPECT_TRUE(information.isZero());
}

}  // namespace
}  // namespace taclink
