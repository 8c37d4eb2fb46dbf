// Pressure, weight and forces of designs, against closed forms and other solvers.
#include "sensing/design/mechanics.h"

#include <gtest/gtest.h>

#include <cmath>

#include "sensing/design/skin_check.h"
#include "sensing/model/model_file.h"
#include "sensing/shell/skin_push.h"

namespace taclink {
namespace {

// The equilibrium of a long neo-Hookean membrane tube that keeps its length: p = E t / (3 R) (1 - lambda^-4),
// at the limit of growth, lambda = 1.5.
TEST(DesignMechanics, ALongRubberTubeRunsAwayAtItsMembranePressure) {
  LinkModel model = LoadLinkModel("cylinder").value();
  model.length_mm = 500;
  model.thickness_mm = model.profile_depth_mm = 1;
  model.material = {.youngs_modulus_mpa = 0.1, .poisson_ratio = 0.5, .law = MaterialLaw::kNeoHookean};
  model.markers.rings_z_mm.clear();
  for (int ring = 1; ring < 25; ++ring) model.markers.rings_z_mm.push_back(20.0 * ring);
  const ShellMesh mesh = MakeShellMesh(model, 1);
  const NonlinearShell shell(SkinSurface(mesh), model.material);
  const PressureLimits limits = FindPressureLimits(shell, 2e-3);
  ASSERT_TRUE(limits.runs_away_mpa);
  const double membrane_mpa = 0.1 / 3 * 1 / 37.0 * (1 - std::pow(1.5, -4));
  EXPECT_NEAR(*limits.runs_away_mpa, membrane_mpa, 0.04 * membrane_mpa);
  ASSERT_TRUE(limits.buckles_mpa);
  EXPECT_LT(*limits.buckles_mpa, 0);
}

// Donnell's closed form for a cylinder with simply supported ends under lateral pressure. Clamped ends and
// the pull along the axis that they keep make it higher.
TEST(DesignMechanics, BucklingIsNearTheClassicalPressure) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  const ShellMesh mesh = MakeShellMesh(model, 1);
  const NonlinearShell shell(SkinSurface(mesh), model.material);
  const PressureLimits limits = FindPressureLimits(shell, 1e-3);
  ASSERT_TRUE(limits.buckles_mpa);
  const double t_over_r = 3.5 / 38.25, l_over_r = 198 / 38.25;
  const double simple = 0.855 * 0.1002 * std::pow(t_over_r, 2.5) / (std::pow(0.75, 0.75) * l_over_r);
  EXPECT_GT(-*limits.buckles_mpa, simple);
  EXPECT_LT(-*limits.buckles_mpa, 2.2 * simple);
}

// Mass of a tube; the lying skin sags by 3.56 mm as CalculiX's bricks do, upright like a bar by
// rho g L^2 / (8 E) in the plane stress of a tube that cannot narrow freely.
TEST(DesignMechanics, WeightIsThatOfTheSolid) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  SkinMechanics mechanics(model);
  const auto sag = FindWeightSag(mechanics, 0);
  ASSERT_TRUE(sag);
  const double mass_kg = 1070e-9 * kPi * (40 * 40 - 36.5 * 36.5) * 198;
  EXPECT_NEAR(sag->mass_kg, mass_kg, 0.01 * mass_kg);
  ASSERT_TRUE(sag->sag_mm[static_cast<size_t>(Attitude::kLying)]);
  EXPECT_NEAR(*sag->sag_mm[static_cast<size_t>(Attitude::kLying)], 3.56, 0.2);
  const double bar_mm = 1070e-9 * kStandardGravity * 198 * 198 / (8 * 0.1002);
  for (const Attitude attitude : {Attitude::kUpright, Attitude::kHanging}) {
    ASSERT_TRUE(sag->sag_mm[static_cast<size_t>(attitude)]);
    EXPECT_NEAR(*sag->sag_mm[static_cast<size_t>(attitude)], bar_mm, 0.15 * bar_mm);
  }
}

TEST(DesignMechanics, RangeEndsWhereADomeMeetsTheTube) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  const auto design = AnalyzeSkin(model, {.pressure_mpa = 1e-3});
  ASSERT_TRUE(design.ok());
  ASSERT_TRUE(design->loaded);
  for (const int ring : {0, 4, 9}) {
    const auto i = static_cast<size_t>(ring);
    const RingForce& slack = design->slack.forces.by_ring[i];
    EXPECT_NEAR(slack.room_mm, 36.5 - 15 - 1.4, 1e-9);
    ASSERT_TRUE(slack.range_mm && slack.range_n);
    EXPECT_EQ(slack.end, RingForce::End::kTube);
    EXPECT_NEAR(*slack.range_mm, slack.room_mm, 1e-6);
    // On a finer mesh, without steps on the way.
    const auto fine = PushSkin(model, {.marker = model.MarkerIndex(3, ring), .depth_mm = slack.room_mm});
    ASSERT_TRUE(fine.ok());
    EXPECT_NEAR(*slack.range_n, fine->force_n, 0.2 * fine->force_n) << ring;
    const RingForce& loaded = design->loaded->forces.by_ring[i];
    ASSERT_TRUE(loaded.range_mm && loaded.least_n && slack.least_n);
    EXPECT_GT(*loaded.range_mm, *slack.range_mm) << "it begins further out";
    EXPECT_GT(*loaded.least_n, *slack.least_n) << "tension stiffens";
    EXPECT_GT(*slack.least_n, 0);
  }
}

// A dent by the least force moves the markers by a few of their standard deviations: no less than what one
// marker alone would need, shared among the markers of a dent.
TEST(DesignMechanics, LeastForceGoesWithTheImages) {
  const LinkModel model = LoadLinkModel("third").value();
  const auto sharp = AnalyzeSkin(model, {.marker_sigma_px = 0.1});
  const auto blurred = AnalyzeSkin(model, {.marker_sigma_px = 1});
  ASSERT_TRUE(sharp.ok() && blurred.ok());
  for (const size_t ring : {0U, 4U}) {
    const auto &few = sharp->slack.forces.by_ring[ring].least_n,
               &many = blurred->slack.forces.by_ring[ring].least_n;
    ASSERT_TRUE(few && many);
    EXPECT_GT(*many, 2 * *few);
    EXPECT_LT(*many, 10.5 * *few) << "at most in proportion: a floor is the same for both";
  }
}

}  // namespace
}  // namespace taclink
