#include "sensing/estimation/isolated_markers.h"

#include <gtest/gtest.h>

#include <cmath>

#include "sensing/model/model_file.h"

namespace taclink {
namespace {

class HideIsolatedTest : public ::testing::Test {
 protected:
  HideIsolatedTest() {
    observed_.displacement_mm.assign(kMarkers, Vec3::Zero());
    observed_.information.assign(kMarkers, Mat3::Identity() / 0.0025);
  }
  size_t Index(int path, int ring) const { return static_cast<size_t>(model_.MarkerIndex(path, ring)); }
  // A dent as pointed as the neighbors of markers can show.
  void Dent(int path, int ring, double depth_mm) {
    for (int r = ring - 2; r <= ring + 2; ++r) {
      for (int p = path - 3; p <= path + 3; ++p)
        observed_.displacement_mm[Index((p + 24) % 24, r)].x() -=
            depth_mm * std::pow(0.6, std::hypot(p - path, r - ring));
    }
  }

  int Hide(double unit, MarkerObservations& observed) const {
    return HideIsolated(model_, Eigen::VectorXd::Zero(3 * kMarkers), kSurelyIsolated, unit, observed);
  }

  static constexpr size_t kMarkers = 240;
  const LinkModel model_ = LoadLinkModel("cylinder").value();
  MarkerObservations observed_;
};

TEST_F(HideIsolatedTest, FindsOneAnywhere) {
  for (const int ring : {0, 4, 9}) {
    observed_.displacement_mm[Index(0, ring)] = {0, 0, -3};
    EXPECT_EQ(Hide(1, observed_), 1);
    EXPECT_TRUE(observed_.information[Index(0, ring)].isZero());
  }
  EXPECT_EQ(Hide(1, observed_), 0);
}

TEST_F(HideIsolatedTest, LeavesDentsAsTheyAre) {
  Dent(5, 4, 8);
  Dent(23, 5, 3);
  EXPECT_EQ(Hide(1, observed_), 0);
}

TEST_F(HideIsolatedTest, FindsOneBesideADent) {
  Dent(5, 4, 8);
  observed_.displacement_mm[Index(10, 4)] = {4, 2, 0};
  EXPECT_EQ(Hide(1, observed_), 1);
  EXPECT_TRUE(observed_.information[Index(10, 4)].isZero());
}

TEST_F(HideIsolatedTest, GoesByTheSizeOfTheSkin) {
  observed_.displacement_mm[Index(3, 3)] = {0, 0, 1.5};
  EXPECT_EQ(Hide(3, observed_), 0);
  EXPECT_EQ(Hide(1, observed_), 1);
}

// Of one that is alone nobody can tell; along its ray one camera tells nothing.
TEST_F(HideIsolatedTest, GoesByWhatIsSeen) {
  MarkerObservations alone = observed_;
  for (Mat3& information : alone.information) information.setZero();
  const size_t at = Index(3, 3);
  alone.information[at] = observed_.information[at];
  alone.displacement_mm[at] = {0, 0, 5};
  EXPECT_EQ(Hide(1, alone), 0);
  observed_.displacement_mm[at] = {0, 0, 5};
  observed_.information[at](2, 2) = 0;
  EXPECT_EQ(Hide(1, observed_), 0);
}

}  // namespace
}  // namespace taclink
