#include "sensing/shape/inference.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "sensing/model/model_file.h"
#include "tests/sensing/shape/support.h"

namespace taclink {
namespace {

TEST(InferUnseen, HiddenBottomOfADentFollowsFromItsFlanks) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  const auto truth = TrueMarkers(model, {{1.0, 0.45, 8}});
  const auto rest = model.RestMarkers();
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 0.05);
  SkinShape shape;
  size_t deepest = 0;
  for (size_t m = 0; m < truth.size(); ++m) {
    if ((truth[m] - rest[m]).norm() > (truth[deepest] - rest[deepest]).norm()) deepest = m;
    shape.positions_mm.push_back(truth[m]);
    shape.displacements_mm.push_back(truth[m] - rest[m]);
    shape.covariances_mm2.push_back(0.05 * 0.05 * Mat3::Identity());
    shape.sources.push_back(MarkerSource::kBoth);
    shape.measured.push_back({shape.displacements_mm[m] + Vec3(noise(random), noise(random), noise(random)),
                              400 * Mat3::Identity()});
  }
  const SkinShape seen = shape;
  shape.sources[deepest] = MarkerSource::kInferred;
  shape.measured[deepest] = {};
  shape.positions_mm[deepest] = rest[deepest];
  shape.displacements_mm[deepest].setZero();
  InferUnseen(model, {}, shape);
  const Vec3 error = shape.positions_mm[deepest] - truth[deepest];
  EXPECT_LT(error.norm(), 0.15 * (truth[deepest] - rest[deepest]).norm());
  EXPECT_LT(error.dot(shape.covariances_mm2[deepest].inverse() * error), 12);
  EXPECT_LT(shape.covariances_mm2[deepest].trace(), 4);
  EXPECT_EQ(shape.displacements_mm[0], seen.displacements_mm[0]);
}

}  // namespace
}  // namespace taclink
