#include "sensing/core/similar_skin.h"

#include <gtest/gtest.h>

#include "sensing/camera/projection.h"
#include "sensing/model/model_file.h"

namespace taclink {
namespace {

class SimilarSkinTest : public ::testing::TestWithParam<std::string> {};

// Its pictures are those of the real one: of markers, of the wall and of points of it that are pushed in.
TEST_P(SimilarSkinTest, LooksTheSameAndHasTheUsualSize) {
  const LinkModel real = LoadLinkModel(GetParam()).value();
  const SimilarSkin similar(real, real.nominal_rig);
  EXPECT_NEAR(LengthUnit(similar.model), 1, 1e-12);
  int seen = 0;
  for (const CameraId id : kBothCameras) {
    const Projector a(real.nominal_rig[id]), b(similar.rig[id]), nominal(similar.model.nominal_rig[id]);
    for (int m = 0; m < real.markers.count(); ++m) {
      const Vec3 in = real.RestMarker(m) - 5 * real.OutwardNormal(real.PathAngle(real.PathOf(m)), 0);
      const auto pixel = a.Project(in), same = b.Project(similar.scale * in);
      ASSERT_EQ(pixel.has_value(), same.has_value());
      if (!pixel) continue;
      ++seen;
      EXPECT_LT((*pixel - *same).norm(), 1e-9);
      EXPECT_LT((*a.Project(real.RestMarker(m)) - *nominal.Project(similar.model.RestMarker(m))).norm(),
                1e-9);
    }
  }
  EXPECT_GT(seen, real.markers.count());
  for (const double share : {0.0, 0.3, 0.8}) {
    const double z = share * real.length_mm;
    const Vec3 wall = real.PointAtDepth(1, z, real.thickness_mm);
    const Vec3 scaled = similar.model.PointAtDepth(1, similar.scale * z, similar.model.thickness_mm);
    EXPECT_LT((similar.scale * wall - scaled).norm(), 1e-9);
    EXPECT_LT((real.OutwardNormal(1, z) - similar.model.OutwardNormal(1, similar.scale * z)).norm(), 1e-12);
  }
}

INSTANTIATE_TEST_SUITE_P(Shipped, SimilarSkinTest, ::testing::ValuesIn(ShippedModelNames()),
                         [](const auto& name) { return name.param; });

TEST(LengthUnit, OfTheShippedCylinderIsOne) {
  EXPECT_NEAR(LengthUnit(LoadLinkModel("cylinder").value()), 1, 1e-4);
  EXPECT_NEAR(DecayLengthMm(LoadLinkModel("cylinder").value()), 11.57, 0.01);
}

}  // namespace
}  // namespace taclink
