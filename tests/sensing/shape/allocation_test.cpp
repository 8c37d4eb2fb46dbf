#include <gtest/gtest.h>

#include "sensing/model/model_file.h"
#include "sensing/shape/reconstructor.h"
#include "tests/sensing/shape/support.h"
#include "tests/support/count_allocations.h"

namespace taclink {
namespace {

TEST(ShapeAllocation, NoneOnceRunning) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  ShapeReconstructor reconstructor(model, model.nominal_rig);
  Eyes eyes(model.nominal_rig);
  reconstructor.SetBaseline(eyes.See(model.RestMarkers(), 0.1));
  SkinShape shape;
  const auto still = eyes.See(model.RestMarkers(), 0.3);
  const auto touched = eyes.See(TrueMarkers(model, {{1, 0.4, 8}, {4, 0.6, 5}}), 0.3);
  LabelledMarkers outlier = touched;
  outlier.cameras[0][50].center_px += Vec2(20, 0);
  reconstructor.Reconstruct(outlier, 0, shape);
  const long before = allocations;
  for (const LabelledMarkers* labels : {&still, &touched, static_cast<const LabelledMarkers*>(&outlier)})
    reconstructor.Reconstruct(*labels, 0, shape);
  EXPECT_GT(before, 0);
  EXPECT_EQ(allocations - before, 0);
}

}  // namespace
}  // namespace taclink
