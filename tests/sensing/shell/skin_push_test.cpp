#include "sensing/shell/skin_push.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "sensing/model/model_file.h"
#include "sensing/shell/pressed_skin.h"

namespace taclink {
namespace {

class SkinPushTest : public ::testing::Test {
 protected:
  double ForceN(double pressure_kpa, double depth_mm, int refinement = 1) const {
    const auto result = PushSkin(model_, {.marker = model_.MarkerIndex(6, 4),
                                          .depth_mm = depth_mm,
                                          .pressure_mpa = pressure_kpa * 1e-3,
                                          .refinement = refinement,
                                          .force_model = ForceModel::kLinear});
    EXPECT_TRUE(result.ok());
    return result->force_n;
  }
  // With 0.1 MPa, as the tables that are compared with.
  static LinkModel Model() {
    LinkModel model = LoadLinkModel("cylinder").value();
    model.material.youngs_modulus_mpa = 0.1;
    return model;
  }
  const LinkModel model_ = Model();
};

// Linear column of the probe table: an independent linear MITC4 model, one node pushed. Its elements have no
// residual bending flexibility (mitc4.md), so that it is stiffer than this one, which is nearer to finer
// meshes.
TEST_F(SkinPushTest, AgreesWithTheLinearProbeTable) {
  const auto expect = [&](double pressure_kpa, double depth_mm, double table_n) {
    const double share = ForceN(pressure_kpa, depth_mm) / table_n;
    EXPECT_LT(share, 1) << pressure_kpa << " kPa, " << depth_mm << " mm";
    EXPECT_GT(share, 0.88) << pressure_kpa << " kPa, " << depth_mm << " mm";
  };
  expect(0, 5, 0.13);
  expect(0, 10, 0.27);
  expect(0.5, 5, 0.17);
  expect(1.0, 10, 0.34);
  expect(1.5, 5, 0.25);
  expect(1.5, 10, 0.38);
  EXPECT_NEAR(ForceN(0, 5) / ForceN(0, 5, 3), 1, 0.08);
}

TEST_F(SkinPushTest, FinerMeshPushesMoreNodesAndStaysClose) {
  const auto fine = PushSkin(model_, {.marker = model_.MarkerIndex(6, 4),
                                      .depth_mm = 5,
                                      .refinement = 4,
                                      .force_model = ForceModel::kLinear});
  ASSERT_TRUE(fine.ok());
  EXPECT_GE(fine->nodes_in_contact, 2);
  EXPECT_NEAR(fine->force_n / ForceN(0, 5), 1, 0.15);
}

TEST_F(SkinPushTest, ASkinThatBucklesUnderSuctionSaysSo) {
  PressedSkin sucked(model_, {.refinement = 1}), inflated(model_, {.refinement = 1});
  const PressSummary buckled = sucked.Inflate(-0.25e-3), grown = inflated.Inflate(1e-3);
  ASSERT_TRUE(buckled.ok() && grown.ok());
  EXPECT_GE(buckled.snaps, 1);
  EXPECT_GT(buckled.snapped_mm, 5);
  EXPECT_THAT(buckled.Text(), ::testing::HasSubstr("snapped"));
  EXPECT_EQ(grown.snaps, 0);
  EXPECT_THAT(grown.Text(), ::testing::Not(::testing::HasSubstr("snapped")));
}

TEST_F(SkinPushTest, DiscThatDoesNotTouchFeelsNothing) {
  EXPECT_EQ(ForceN(0, -1), 0);
  EXPECT_GT(ForceN(1.5, -1), 0);  // inflated by more than 1 mm
}

TEST_F(SkinPushTest, RefusesWhatCannotBe) {
  const auto message = [&](const SkinPush& push) {
    const auto result = PushSkin(model_, push);
    return result.ok() ? std::string("accepted") : result.error().message;
  };
  EXPECT_THAT(message({.marker = 240, .depth_mm = 1}), ::testing::HasSubstr("24 paths and 10 rings"));
  EXPECT_THAT(message({.marker = 0, .depth_mm = 22}), ::testing::HasSubstr("at most 21.5 mm"));
  EXPECT_THAT(message({.marker = 0, .depth_mm = std::nan("")}), ::testing::HasSubstr("finite"));
}

}  // namespace
}  // namespace taclink
