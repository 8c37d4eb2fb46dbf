// The untouched skin under known loads against equilibria by Newton's method.
#include "sensing/estimation/skin_mechanics.h"

#include <gtest/gtest.h>

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "sensing/model/model_file.h"
#include "sensing/shell/equilibrium.h"

namespace taclink {
namespace {

class SkinMechanicsTest : public ::testing::TestWithParam<const char*> {
 protected:
  // In steps from the slack skin, on the same mesh.
  Eigen::VectorXd Solved(const KnownLoads& loads) {
    EquilibriumSolver solver(mechanics_.shell(), {.tolerance_n = 1e-9, .max_iterations = 200});
    ShellState state = mechanics_.shell().Rest();
    constexpr int kSteps = 10;
    for (int step = 1; step <= kSteps; ++step) {
      const AppliedLoads applied(mechanics_, KnownLoads::FromStacked(loads.Stacked() * step / kSteps));
      EXPECT_TRUE(solver.Solve(applied.loads(), {}, state).ok());
    }
    Eigen::VectorXd markers_mm;
    mechanics_.markers().Displacements(state, markers_mm);
    return markers_mm;
  }
  static double Largest(const Eigen::VectorXd& stacked_mm) {
    return std::sqrt(stacked_mm.reshaped(3, stacked_mm.size() / 3).colwise().squaredNorm().maxCoeff());
  }

  SkinMechanics mechanics_{LoadLinkModel(GetParam()).value()};
};

TEST_P(SkinMechanicsTest, IsTheEquilibriumUnderAnyKnownLoads) {
  for (const KnownLoads& loads :
       {KnownLoads{0, {0, -9.8, 0}}, KnownLoads{3.3e-4, {4.9, -6.9, -4.9}}, KnownLoads{1.07e-3, {1, 2, 9}},
        KnownLoads{6.1e-4}, KnownLoads{0, {3, 9.5, -4}}}) {
    const UntouchedSkin* skin = mechanics_.Untouched(loads);
    ASSERT_TRUE(skin != nullptr);
    EXPECT_EQ(skin->loads.pressure_mpa, loads.pressure_mpa);
    const Eigen::VectorXd expected_mm = Solved(loads);
    EXPECT_LT(Largest(skin->markers_mm - expected_mm), 1e-3) << loads.Stacked().transpose();
    EXPECT_GT(Largest(expected_mm), 0.5);
  }
}

TEST_P(SkinMechanicsTest, KnowsItsDerivatives) {
  const KnownLoads at{4e-4, {3, -7, 2}};
  const ByKnownLoads by_loads = mechanics_.Untouched(at)->markers_by_loads;
  for (int k = 0; k < KnownLoads::kCount; ++k) {
    const Vec4 step = Vec4::Unit(k) * (k == 0 ? 4e-5 : 0.5);
    const Eigen::VectorXd difference_mm = Solved(KnownLoads::FromStacked(at.Stacked() + step)) -
                                          Solved(KnownLoads::FromStacked(at.Stacked() - step));
    const Eigen::VectorXd expected = difference_mm / (2 * step[k]);
    EXPECT_LT((by_loads.col(k) - expected).norm(), 0.03 * expected.norm()) << k;
  }
}

TEST_P(SkinMechanicsTest, RefusesLoadsBeyondAllMeasure) {
  const double nan = std::nan("");
  for (const KnownLoads& loads : {KnownLoads{nan}, KnownLoads{0, {0, nan, 0}}, KnownLoads{1},
                                  KnownLoads{0, {1e5, 0, 0}}, KnownLoads{-1}})
    EXPECT_EQ(mechanics_.Untouched(loads), nullptr) << loads.Stacked().transpose();
}

// An arm that turns about all axes while it is inflated: what is kept is bounded, and what comes back is the
// same, to the last bit.
TEST_P(SkinMechanicsTest, ForgetsAndFindsAgain) {
  const KnownLoads first{2e-4, {9.8, 0, 0}};
  const UntouchedSkin before = *mechanics_.Untouched(first);
  for (int i = 0; i < 60; ++i) {
    const double a = 0.7 * i, b = 0.31 * i;
    const Vec3 down = 9.8 * Vec3(std::cos(a) * std::cos(b), std::sin(a) * std::cos(b), std::sin(b));
    ASSERT_TRUE(mechanics_.Untouched({1e-5 * i, down}) != nullptr) << i;
  }
  const UntouchedSkin* again = mechanics_.Untouched(first);
  EXPECT_EQ(again->markers_mm, before.markers_mm);
  EXPECT_EQ(again->markers_by_loads, before.markers_by_loads);
}

// A gauge scatters about zero. Farther down the skin buckles, and the nearest pressure that it stands is
// taken; farther still there is none.
TEST_P(SkinMechanicsTest, StandsLittleSuction) {
  const double step = mechanics_.pressure_step();
  const UntouchedSkin* skin = mechanics_.Untouched({-0.02 * step});
  ASSERT_TRUE(skin != nullptr);
  EXPECT_EQ(skin->loads.pressure_mpa, -0.02 * step);
  double lowest = 0;
  do {
    lowest -= 0.1 * step;
    skin = mechanics_.Untouched({lowest});
    ASSERT_GT(lowest, -100 * step);
  } while (skin != nullptr && skin->loads.pressure_mpa == lowest);
  ASSERT_TRUE(skin != nullptr) << "buckled by " << lowest;
  EXPECT_GT(skin->loads.pressure_mpa, lowest);
  EXPECT_LT(skin->loads.pressure_mpa, lowest + 0.5 * step);
  EXPECT_EQ(mechanics_.Untouched({lowest - 4 * step}), nullptr);
}

// A slack skin that is accelerated across its axis sags onto its tube, and is then touched by that. Before,
// it is the equilibrium.
TEST_P(SkinMechanicsTest, StandsClearOfItsTube) {
  const double least_mm = mechanics_.model().tube_outer_radius_mm + mechanics_.model().thickness_mm / 2;
  const double sag_mm = Largest(mechanics_.Untouched({0, {1, 0, 0}})->markers_mm);
  bool is_clear = true;
  for (double across_mps2 = 2 * mechanics_.length_unit() / sag_mm; across_mps2 * sag_mm < 60 * least_mm;
       across_mps2 *= 1.4) {
    const KnownLoads loads{0, {across_mps2, 0, 0}};
    const UntouchedSkin* skin = mechanics_.Untouched(loads);
    if (skin != nullptr) {
      EXPECT_TRUE(is_clear) << "beyond what was refused, " << across_mps2 << " m/s^2";
      for (const Vec3& mid : skin->state.mids_mm) EXPECT_GT(mid.head<2>().norm(), least_mm);
      EXPECT_LT(Largest(skin->markers_mm - Solved(loads)), 2e-3 * mechanics_.length_unit()) << across_mps2;
    }
    is_clear = skin != nullptr;
  }
  EXPECT_FALSE(is_clear);
}

// A gauge's scatter about zero, of a skin that lies on its side: the nearest pressure at which it stands
// clear.
TEST_P(SkinMechanicsTest, StandsLittleSuctionUnderItsWeight) {
  const double step = mechanics_.pressure_step();
  for (const double steps : {-0.1, -0.6, -1.0, -1.7}) {
    const UntouchedSkin* skin = mechanics_.Untouched({steps * step, {9.8, 0, 0}});
    ASSERT_TRUE(skin != nullptr) << steps;
    EXPECT_GE(skin->loads.pressure_mpa, steps * step);
    EXPECT_LE(skin->loads.pressure_mpa, 0);
    EXPECT_LT(Largest(skin->markers_mm - Solved(skin->loads)), 2e-3 * mechanics_.length_unit());
  }
}

// Against the inertia and the solutions of the Hessian: suction at which the grid's next point is stable, and
// sideways loads up to where the skin falls onto its tube.
TEST_P(SkinMechanicsTest, IsStableWithItsDerivatives) {
  const double step = mechanics_.pressure_step();
  std::vector<KnownLoads> all;
  for (double steps = -1; steps < -0.5; steps += 0.043) all.push_back({steps * step, {0, 0, 9.8}});
  for (double across_mps2 = 4; across_mps2 < 20; across_mps2 *= 1.15) all.push_back({0, {across_mps2, 0, 1}});
  Eigen::SparseMatrix<double> hessian = mechanics_.shell().Pattern();
  Eigen::VectorXd gradient;
  ByKnownLoads by_loads;
  MarkerMap::Jacobian jacobian = mechanics_.markers().MakeJacobian(mechanics_.shell());
  int found = 0;
  for (const KnownLoads& loads : all) {
    const UntouchedSkin* skin = mechanics_.Untouched(loads);
    if (skin == nullptr) continue;
    ++found;
    const AppliedLoads applied(mechanics_, skin->loads);
    mechanics_.shell().Hessian(skin->state, applied.loads(), gradient, hessian);
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(hessian);
    EXPECT_GT(factor.vectorD().minCoeff(), 0) << loads.Stacked().transpose();
    mechanics_.GradientByLoads(skin->state, by_loads);
    mechanics_.markers().WriteJacobian(mechanics_.shell(), skin->state, jacobian);
    for (int k = 0; k < KnownLoads::kCount; ++k) {
      const Eigen::VectorXd expected = -(jacobian * factor.solve(by_loads.col(k)));
      EXPECT_LT((skin->markers_by_loads.col(k) - expected).norm(), 0.08 * expected.norm())
          << loads.Stacked().transpose() << ", by " << k;
    }
  }
  EXPECT_GE(found, 10);
}

// A model that does not say how heavy its skin is: as if it were weightless.
TEST(WeightlessSkinTest, IsMovedByPressureAlone) {
  LinkModel model = LoadLinkModel("cylinder").value();
  model.density_kg_m3 = 0;
  SkinMechanics mechanics(model);
  EXPECT_TRUE(mechanics.Untouched({0, {0, -9.8, 0}})->markers_mm.isZero(1e-12));
  EXPECT_TRUE(mechanics.Untouched({5e-4})->markers_by_loads.rightCols<3>().isZero(0));
}

INSTANTIATE_TEST_SUITE_P(Skins, SkinMechanicsTest,
                         ::testing::Values("cylinder", "barrel", "third", "bottle"));

}  // namespace
}  // namespace taclink
