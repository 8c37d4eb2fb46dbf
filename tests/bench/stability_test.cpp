#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "bench/stability/stability_cases.h"
#include "bench/stability/stability_measure.h"
#include "sensing/model/model_file.h"
#include "sensing/shell/shell_mesh.h"

namespace taclink {
namespace {

LinkModel ShippedCylinder() {
  return LoadLinkModel("cylinder").value();
}

TEST(Simpson, IsExactForCubics) {
  std::vector<double> y;
  for (int i = 0; i <= 4; ++i) y.push_back(std::pow(0.5 * i, 3));
  EXPECT_NEAR(Simpson(y, 0.5), 4, 1e-12);
}

TEST(StabilityMeasure, KnowsAGoodTangentAndABadOne) {
  const LinkModel model = ShippedCylinder();
  const NonlinearShell shell(SkinSurface(MakeShellMesh(model, 1)), model.material);
  const TangentNumbers numbers = MeasureTangent(shell, {}, shell.Rest());
  ASSERT_TRUE(numbers.definite);
  EXPECT_GT(numbers.condition, 10);
  EXPECT_LT(numbers.backward_error, 1e-13);
  EXPECT_GT(numbers.float_error, 1e-9);
  EXPECT_LT(numbers.float_error, 1e-2);
  EXPECT_LT(Reciprocity(shell, {}, shell.Rest(), 2, 200), 1e-6);
  EXPECT_LT(ResidualOf(shell, {}, shell.Rest()), 1e-12);
  const FollowerPressure suction(-0.05);
  const ElementLoad* const load[] = {&suction};
  EXPECT_FALSE(MeasureTangent(shell, load, shell.Rest()).definite);
  EXPECT_GT(ResidualOf(shell, load, shell.Rest()), 1e-3);
}

TEST(StabilityCases, KeepTheMidSurfaceAndTheStrain) {
  const LinkModel base = ShippedCylinder();
  const LinkModel thin = VariedModel(base, 10, 0.01, 0.3, MaterialLaw::kSaintVenantKirchhoff);
  EXPECT_NEAR(thin.PointAtDepth(0, 100, thin.thickness_mm / 2).x(), 38.25, 1e-9);
  EXPECT_NEAR(thin.thickness_mm, 0.3825, 1e-12);
  EXPECT_NEAR(ScaledPressureMpa(base, thin, 1), 1e-3 * 100 * 0.3825 / 3.5, 1e-12);
  for (const SkinCase& c : SkinCases(base)) {
    if (c.model.material.law == MaterialLaw::kNeoHookean) {
      EXPECT_EQ(c.model.material.poisson_ratio, 0.5) << c.name;
    }
  }
}

TEST(StabilityCases, AStiffSkinEndsRightAndAnImpossibleLoadIsRefused) {
  const LinkModel base = ShippedCylinder();
  SkinCase stiff{.name = "stiff",
                 .model = VariedModel(base, 1e3, 0.0915, 0.49, MaterialLaw::kSaintVenantKirchhoff),
                 .pressure_mpa = 0,
                 .depth_mm = 3,
                 .reference_modulus_mpa = 0.1};
  stiff.pressure_mpa = ScaledPressureMpa(base, stiff.model, 1);
  const StabilityRow right = RunSkinCase(stiff, 1);
  EXPECT_EQ(right.ending, Ending::kRight) << right.reason;
  EXPECT_GT(right.condition, 1);
  EXPECT_LT(right.energy_error, 0.01);
  stiff.pressure_mpa = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(RunSkinCase(stiff, 1).ending, Ending::kRefused);
}

// 5 g, which is to 1 MPa as half of gravity is to 0.1 MPa.
TEST(StabilityCases, AStiffSkinThatLiesEndsRight) {
  const LinkModel base = ShippedCylinder();
  SkinCase lying{.name = "lying",
                 .model = VariedModel(base, 1, 0.0915, 0.49, MaterialLaw::kSaintVenantKirchhoff),
                 .pressure_mpa = 0,
                 .depth_mm = 3,
                 .specific_force_mps2 = Vec3(0, -50, 0),
                 .reference_modulus_mpa = 0.1};
  lying.pressure_mpa = ScaledPressureMpa(base, lying.model, 1);
  const StabilityRow right = RunSkinCase(lying, 1);
  EXPECT_EQ(right.ending, Ending::kRight) << right.reason;
  EXPECT_LT(right.energy_error, 0.01);
  lying.specific_force_mps2.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(RunSkinCase(lying, 1).ending, Ending::kRefused);
}

}  // namespace
}  // namespace taclink
