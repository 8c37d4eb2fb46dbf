#include <gtest/gtest.h>

#include "sensing/model/model_file.h"
#include "wire/convert.h"

namespace taclink::wire {
namespace {

TEST(ArmCodec, ModelIsInMetresPascalsAndMarkerOrder) {
  const auto model = LoadLinkModel("barrel");
  ASSERT_TRUE(model.ok());
  v1::LinkModel message;
  Fill(*model, message);
  EXPECT_EQ(message.name(), "barrel");
  EXPECT_DOUBLE_EQ(message.length_m(), model->length_mm / 1000);
  EXPECT_DOUBLE_EQ(message.material().youngs_modulus_pa(), model->material.youngs_modulus_mpa * 1e6);
  const auto& grid = message.markers();
  ASSERT_EQ(grid.rest_positions_m_size(), model->markers.count() * 3);
  ASSERT_EQ(grid.ring_z_m_size(), model->markers.rings());
  const int marker = model->MarkerIndex(3, 5);
  const Vec3 p_mm = model->RestMarker(marker);
  for (int axis = 0; axis < 3; ++axis)
    EXPECT_NEAR(grid.rest_positions_m(marker * 3 + axis), p_mm[axis] / 1000, 1e-8);
}

TEST(ArmCodec, ProfileIsTheOuterSurfaceFromEndToEnd) {
  const auto model = LoadLinkModel("barrel");
  ASSERT_TRUE(model.ok());
  v1::LinkModel message;
  Fill(*model, message);
  ASSERT_EQ(message.profile_z_m_size(), message.profile_radius_m_size());
  EXPECT_EQ(message.profile_z_m(0), 0);
  EXPECT_DOUBLE_EQ(*message.profile_z_m().rbegin(), message.length_m());
  for (int i = 1; i < message.profile_z_m_size(); ++i)
    EXPECT_GT(message.profile_z_m(i), message.profile_z_m(i - 1));
  const int middle = message.profile_z_m_size() / 2;
  EXPECT_NEAR(message.profile_radius_m(middle), model->PointAtDepth(0, model->length_mm / 2, 0).x() / 1000,
              1e-12);
}

TEST(ArmCodec, PoseTurnsPointsLikeTheTransform) {
  const Rigid3 base_from_link{Mat3(Eigen::AngleAxisd(1.2, Vec3(1, -2, 0.5).normalized())),
                              Vec3(10, -20, 300)};
  v1::Pose message;
  Fill(base_from_link, message);
  const Eigen::Quaterniond q(message.rotation().w(), message.rotation().x(), message.rotation().y(),
                             message.rotation().z());
  const Vec3 p_in_link_mm(4, 5, 6);
  const Vec3 p_in_base_m = q * (p_in_link_mm / 1000) + FromWire(message.translation_m(), 1);
  EXPECT_NEAR((p_in_base_m * 1000 - base_from_link * p_in_link_mm).norm(), 0, 1e-9);
}

}  // namespace
}  // namespace taclink::wire
