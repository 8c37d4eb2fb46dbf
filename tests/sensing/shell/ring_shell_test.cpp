// Energies and gradients ring by ring against those element by element.
#include "sensing/shell/ring_shell.h"

#include <gtest/gtest.h>

#include <random>
#include <tuple>

#include "sensing/model/model_file.h"
#include "sensing/shell/body_force.h"
#include "sensing/shell/nonlinear_shell.h"
#include "sensing/shell/rigid_contact.h"

namespace taclink {
namespace {

ShellSurface SurfaceOf(const LinkModel& model, int around) {
  LinkModel other = model;
  other.markers.paths = around;
  return SkinSurface(MakeShellMesh(other, MeshRefinement{1, 1}));
}

ShellState Deformed(const NonlinearShell& shell, double size_mm, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Eigen::VectorXd step(shell.dof_count());
  for (Eigen::Index i = 0; i < step.size(); ++i) step[i] = size_mm * normal(random) / (i % 5 < 3 ? 1 : 4);
  ShellState state = shell.Rest();
  shell.Step(step, state);
  return state;
}

// The law, and how many elements there are around: not a multiple of any vector's lanes, too.
class RingShellTest : public ::testing::TestWithParam<std::tuple<MaterialLaw, int>> {
 protected:
  RingShellTest() {
    LinkModel model = LoadLinkModel("barrel").value();
    model.material.law = std::get<0>(GetParam());
    if (model.material.law == MaterialLaw::kNeoHookean) model.material.poisson_ratio = 0.5;
    ShellSurface surface = SurfaceOf(model, std::get<1>(GetParam()));
    by_rings_ = std::make_unique<NonlinearShell>(surface, model.material);
    surface.columns = 0;
    by_elements_ = std::make_unique<NonlinearShell>(surface, model.material);
  }
  std::unique_ptr<NonlinearShell> by_rings_, by_elements_;
};

TEST_P(RingShellTest, IsTheSumOfItsElements) {
  ASSERT_TRUE(by_rings_->rings().has_value());
  ASSERT_FALSE(by_elements_->rings().has_value());
  const ShellState state = Deformed(*by_rings_, 0.3, 1);
  const FollowerPressure pressure(1e-3);
  const auto areas = CornerAreas(by_rings_->surface());
  const BodyForce weight(areas, {1e-5, 2e-5, -3e-5});
  RigidContact ball(*by_rings_, {.spacing_mm = 2, .stiffness_n_mm3 = 0.5});
  ball.SetBody(RigidSphere{{47, 5, 60}, 12});
  ASSERT_GT(ball.Summarize(state).points, 3);
  const ElementLoad* all[] = {&pressure, &weight, &ball};
  for (size_t count = 0; count <= 3; ++count) {
    const NonlinearShell::Loads loads(all, count);
    Eigen::VectorXd gradient, expected;
    const double energy = by_rings_->Gradient(state, loads, gradient);
    const double expected_energy = by_elements_->Gradient(state, loads, expected);
    EXPECT_LT((gradient - expected).norm(), 1e-11 * expected.norm()) << count;
    EXPECT_NEAR(energy, expected_energy, 1e-11 * std::abs(expected_energy)) << count;
    EXPECT_NEAR(by_rings_->Energy(state, loads), expected_energy, 1e-11 * std::abs(expected_energy)) << count;
    Eigen::SparseMatrix<double> hessian = by_rings_->Pattern(), expected_hessian = hessian;
    by_rings_->Hessian(state, loads, gradient, hessian);
    by_elements_->Hessian(state, loads, expected, expected_hessian);
    EXPECT_LT((hessian - expected_hessian).norm(), 1e-11 * expected_hessian.norm()) << count;
  }
}

TEST_P(RingShellTest, WhatHasNoAnswerIsInfinite) {
  if (std::get<0>(GetParam()) != MaterialLaw::kNeoHookean) return;
  ShellState state = by_rings_->Rest();
  for (Vec3& mid : state.mids_mm) mid.setZero();  // no area is left
  for (Vec3& director : state.directors) director = Vec3::UnitX();
  Eigen::VectorXd gradient;
  EXPECT_EQ(by_rings_->Gradient(state, {}, gradient), std::numeric_limits<double>::infinity());
  EXPECT_FALSE(gradient.allFinite());
}

INSTANTIATE_TEST_SUITE_P(
    Skins, RingShellTest,
    ::testing::Combine(::testing::Values(MaterialLaw::kSaintVenantKirchhoff, MaterialLaw::kNeoHookean),
                       ::testing::Values(24, 29, 32)),
    [](const auto& tested) {
      return (std::get<0>(tested.param) == MaterialLaw::kNeoHookean ? "NeoHookean" : "SaintVenantKirchhoff") +
             std::to_string(std::get<1>(tested.param));
    });

// A seam, a dent at rest, or another numbering.
TEST(UnevenShellTest, IsSummedByElements) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  const ShellSurface even = SkinSurface(MakeShellMesh(model, 1));
  EXPECT_TRUE(NonlinearShell(even, model.material).rings().has_value());
  ShellSurface dented = even;
  dented.mids_mm[100] *= 1 + 1e-6;
  EXPECT_FALSE(NonlinearShell(dented, model.material).rings().has_value());
  ShellSurface seamed = even;
  seamed.elements.pop_back();
  EXPECT_FALSE(NonlinearShell(seamed, model.material).rings().has_value());
  ShellSurface turned = even;
  std::rotate(turned.elements[7].begin(), turned.elements[7].begin() + 1, turned.elements[7].end());
  EXPECT_FALSE(NonlinearShell(turned, model.material).rings().has_value());
}

}  // namespace
}  // namespace taclink
