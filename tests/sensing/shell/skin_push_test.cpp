#include "sensing/shell/skin_push.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "sensing/core/known_loads.h"
#include "sensing/model/model_file.h"
#include "sensing/shell/body_force.h"
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
  // On path 7, which is on top where the skin lies, or path 19, which is below.
  static SkinPushResult Held(const LinkModel& model, int path, double depth_mm,
                             const Vec3& specific_force_mps2, ForceModel force_model) {
    const auto result = PushSkin(model, {.marker = model.MarkerIndex(path - 1, 4),
                                         .depth_mm = depth_mm,
                                         .specific_force_mps2 = specific_force_mps2,
                                         .refinement = 1,
                                         .force_model = force_model});
    EXPECT_TRUE(result.ok());
    return result.ok() ? *result : SkinPushResult{};
  }
  std::vector<Vec3> Markers(const PressedSkin& skin) const {
    std::vector<Vec3> markers;
    for (int m = 0; m < model_.markers.count(); ++m) markers.push_back(skin.Marker(m));
    return markers;
  }
  static double Apart(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
    double farthest = 0;
    for (size_t m = 0; m < a.size(); ++m) farthest = std::max(farthest, (a[m] - b[m]).norm());
    return farthest;
  }
  // With 0.1 MPa, as the tables that are compared with.
  static LinkModel Model() {
    LinkModel model = LoadLinkModel("cylinder").value();
    model.material.youngs_modulus_mpa = 0.1;
    return model;
  }
  const LinkModel model_ = Model();
  const Vec3 lying_{0, -kStandardGravity, 0};
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

// CalculiX's solid of the same skin sags by 3.6 mm.
TEST_F(SkinPushTest, ASlackSkinThatLiesSags) {
  PressedSkin upright(model_, {.refinement = 2}), lying(model_, {.refinement = 2});
  ASSERT_TRUE(upright.Load({0, Vec3(0, 0, -kStandardGravity)}).ok());
  const PressSummary sagged = lying.Load({0, lying_});
  ASSERT_TRUE(sagged.ok() && sagged.stable);
  EXPECT_EQ(sagged.snaps, 0);
  EXPECT_EQ(lying.known_loads(), (KnownLoads{0, lying_}));
  EXPECT_NEAR(Apart(Markers(upright), Markers(lying)), 3.6, 0.4);
  EXPECT_LT(Apart(Markers(upright), model_.RestMarkers()), 0.5);
}

TEST_F(SkinPushTest, PressureAndWeightComeInAnyOrder) {
  PressedSkin together(model_, {.refinement = 1}), apart(model_, {.refinement = 1});
  ASSERT_TRUE(together.Load({1e-3, lying_}).ok());
  ASSERT_TRUE(apart.Load({0, lying_}).ok() && apart.Inflate(1e-3).ok());
  EXPECT_EQ(apart.known_loads(), together.known_loads());
  EXPECT_LT(Apart(Markers(together), Markers(apart)), 1e-3);
  // And go again.
  ASSERT_TRUE(apart.Load({}).ok());
  EXPECT_LT(Apart(Markers(apart), model_.RestMarkers()), 1e-3);
}

// Of small loads, a skin stores half the work that their full size would do on the way (Clapeyron's theorem).
TEST_F(SkinPushTest, StoresHalfTheWorkOfALittleWeight) {
  PressedSkin skin(model_, {.refinement = 1});
  const NonlinearShell& shell = skin.shell();
  const Vec3 little(0, -0.05, 0);
  const auto areas_mm2 = CornerAreas(shell.surface());
  const BodyForce weight(areas_mm2, model_.MassPerArea() * little);
  const ElementLoad* loads[] = {&weight};
  const auto stored = [&] { return shell.Energy(skin.state(), {}); };
  const auto fallen = [&] { return stored() - shell.Energy(skin.state(), loads); };
  const double stored_before = stored(), fallen_before = fallen();
  ASSERT_TRUE(skin.Load({0, little}).ok());
  const double work_nmm = fallen() - fallen_before;
  EXPECT_GT(work_nmm, 0);
  EXPECT_NEAR(stored() - stored_before, 0.5 * work_nmm, 0.02 * work_nmm);
}

TEST_F(SkinPushTest, ALyingSkinIsFartherFromADiscAboveAndNearerToOneBelow) {
  const auto push = [&](int path, const Vec3& mps2) {
    return Held(model_, path, 5, mps2, ForceModel::kNonlinear);
  };
  const SkinPushResult weightless = push(7, Vec3::Zero());
  const SkinPushResult above = push(7, lying_), below = push(19, lying_);
  EXPECT_EQ(weightless.inflation_mm, 0);
  EXPECT_NEAR(above.inflation_mm, -3.6, 0.8);
  EXPECT_NEAR(below.inflation_mm, 3.6, 0.8);
  EXPECT_LT(above.force_n, 0.8 * weightless.force_n);
  EXPECT_GT(below.force_n, 1.2 * weightless.force_n);
}

TEST_F(SkinPushTest, ASkinWithoutDensityHasNoWeight) {
  LinkModel model = model_;
  model.density_kg_m3 = 0;
  for (const ForceModel force_model : {ForceModel::kNonlinear, ForceModel::kLinear}) {
    EXPECT_DOUBLE_EQ(Held(model, 7, 5, lying_, force_model).force_n,
                     Held(model_, 7, 5, Vec3::Zero(), force_model).force_n);
  }
}

TEST_F(SkinPushTest, ALittleWeightIsTheSameToBothForceModels) {
  const auto sag = [&](ForceModel force_model) {
    return Held(model_, 7, -1, Vec3(0, -0.1, 0), force_model).inflation_mm;
  };
  EXPECT_NEAR(sag(ForceModel::kLinear) / sag(ForceModel::kNonlinear), 1, 0.1);
}

TEST_F(SkinPushTest, DiscThatDoesNotTouchFeelsNothing) {
  EXPECT_EQ(ForceN(0, -1), 0);
  EXPECT_GT(ForceN(1.5, -1), 0);  // inflated by more than 1 mm
}

// Each disc begins from the same skin, whatever was pressed before it.
TEST_F(SkinPushTest, ALoadedSkinAnswersAsAFreshOne) {
  constexpr double kPressureMpa = 1e-3, kDiscMm = 5.5;
  auto loaded = LoadedSkin::Make(model_, {kPressureMpa, Vec3::Zero()}, {.refinement = 1});
  ASSERT_TRUE(loaded.ok());
  for (const int ring : {4, 0, 4}) {
    const int marker = model_.MarkerIndex(2, ring);
    for (const double depth_mm : {6.0, 2.0}) {
      const auto fresh = PushSkin(
          model_, {.marker = marker, .depth_mm = depth_mm, .pressure_mpa = kPressureMpa, .refinement = 1});
      const auto again = loaded->Push(marker, {&depth_mm, 1}, kDiscMm);
      ASSERT_TRUE(fresh.ok() && again.ok());
      EXPECT_NEAR(again->front().force_n, fresh->force_n, 1e-4 * fresh->force_n) << ring << " " << depth_mm;
    }
  }
}

TEST_F(SkinPushTest, SecantStiffnessIsThatOfAPushFromTheInflatedSurface) {
  constexpr double kPressureMpa = 1.2e-3, kIndentationMm = 4;
  auto loaded = LoadedSkin::Make(model_, {kPressureMpa, Vec3::Zero()}, {.refinement = 1});
  ASSERT_TRUE(loaded.ok());
  const int marker = model_.MarkerIndex(0, 3);
  const auto stiffness = loaded->Stiffness(marker, kIndentationMm, 5.5);
  ASSERT_TRUE(stiffness.ok());
  EXPECT_GT(stiffness->inflation_mm, 3);
  const auto push = PushSkin(model_, {.marker = marker,
                                      .depth_mm = kIndentationMm - stiffness->inflation_mm,
                                      .pressure_mpa = kPressureMpa,
                                      .refinement = 1});
  ASSERT_TRUE(push.ok());
  EXPECT_NEAR(stiffness->force_n, push->force_n, 2e-3 * push->force_n);
  EXPECT_DOUBLE_EQ(stiffness->secant_n_per_mm, stiffness->force_n / kIndentationMm);
}

// The linear shell, another element, pushed at one node. Its load is more concentrated than the disc's, which
// makes it softer; the wall under the disc gives way, which makes the other one softer.
TEST_F(SkinPushTest, OnsetStiffnessIsThatOfTheLinearShell) {
  auto loaded = LoadedSkin::Make(model_, {}, {.refinement = 3});
  ASSERT_TRUE(loaded.ok());
  for (const int ring : {0, 4}) {
    const int marker = model_.MarkerIndex(6, ring);
    const auto linear = PushSkin(
        model_, {.marker = marker, .depth_mm = 1, .refinement = 3, .force_model = ForceModel::kLinear});
    const auto stiffness = loaded->Stiffness(marker, 5, 5.5);
    ASSERT_TRUE(linear.ok() && stiffness.ok());
    EXPECT_NEAR(stiffness->onset_n_per_mm, linear->force_n, 0.12 * linear->force_n) << ring;
  }
}

TEST_F(SkinPushTest, StiffnessNeedsAnIndentationAndAPlace) {
  auto loaded = LoadedSkin::Make(model_, {}, {.refinement = 1});
  ASSERT_TRUE(loaded.ok());
  EXPECT_FALSE(loaded->Stiffness(0, 0, 5.5).ok());
  EXPECT_FALSE(loaded->Stiffness(240, 1, 5.5).ok());
  EXPECT_FALSE(loaded->Stiffness(0, 25, 5.5).ok()) << "beyond the tube";
}

TEST_F(SkinPushTest, RefusesWhatCannotBe) {
  const auto message = [&](const SkinPush& push) {
    const auto result = PushSkin(model_, push);
    return result.ok() ? std::string("accepted") : result.error().message;
  };
  EXPECT_THAT(message({.marker = 240, .depth_mm = 1}), ::testing::HasSubstr("24 paths and 10 rings"));
  EXPECT_THAT(message({.marker = 0, .depth_mm = 22}), ::testing::HasSubstr("at most 21.5 mm"));
  EXPECT_THAT(message({.marker = 0, .depth_mm = std::nan("")}), ::testing::HasSubstr("finite"));
  for (const double mps2 : {std::nan(""), 101.0}) {
    EXPECT_THAT(message({.marker = 0, .depth_mm = 1, .specific_force_mps2 = Vec3(0, mps2, 0)}),
                ::testing::HasSubstr("at most 100 m/s^2"));
  }
}

}  // namespace
}  // namespace taclink
