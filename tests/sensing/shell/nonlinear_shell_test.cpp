#include "sensing/shell/nonlinear_shell.h"

#include <gtest/gtest.h>

#include <random>

#include "sensing/model/model_file.h"
#include "sensing/shell/rigid_contact.h"

namespace taclink {
namespace {

constexpr double kShellThickness = 3.5;

// Four warped elements of a barrel-like surface; no support.
ShellSurface SmallSurface() {
  ShellSurface surface;
  surface.thickness_mm = kShellThickness;
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) {
      const double angle = 0.2 * i + 0.03 * j, z = 10.0 * j + 1.5 * i;
      const double r = 38 + 0.02 * z * z / 3;
      surface.mids_mm.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
      surface.directors.push_back(Vec3(std::cos(angle), std::sin(angle), -0.05 * j).normalized());
      surface.tangents.push_back(surface.directors.back().unitOrthogonal());
      surface.fixed.push_back({});
    }
  }
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 2; ++i) {
      surface.elements.push_back({3 * j + i, 3 * j + i + 1, 3 * j + i + 4, 3 * j + i + 3});
    }
  }
  return surface;
}

ShellState Disturbed(const NonlinearShell& shell, double size_mm, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Eigen::VectorXd step(shell.dof_count());
  for (int node = 0; node < shell.node_count(); ++node) {
    for (int c = 0; c < 5; ++c) {
      if (shell.Dof(node, c) >= 0)
        step[shell.Dof(node, c)] = size_mm * normal(random) / (c < 3 ? 1 : kShellThickness);
    }
  }
  ShellState state = shell.Rest();
  shell.Step(step, state);
  return state;
}

Material MaterialOf(MaterialLaw law) {
  return {
      .youngs_modulus_mpa = 0.1, .poisson_ratio = law == MaterialLaw::kNeoHookean ? 0.5 : 0.4, .law = law};
}

class Derivatives : public ::testing::TestWithParam<MaterialLaw> {
 protected:
  // Gradient against the energy, Hessian against the gradient, along every degree of freedom.
  static void Check(const NonlinearShell& shell, NonlinearShell::Loads loads, const ShellState& state) {
    Eigen::VectorXd gradient, left, right;
    auto hessian = shell.Pattern();
    const double energy = shell.Hessian(state, loads, gradient, hessian);
    EXPECT_NEAR(energy, shell.Energy(state, loads), 1e-12 * std::abs(energy));
    const Eigen::MatrixXd lower(hessian);
    Eigen::MatrixXd full = lower + lower.transpose();
    full.diagonal() = lower.diagonal();
    constexpr double kStep = 1e-4;
    Eigen::VectorXd by_energy(shell.dof_count());
    Eigen::MatrixXd by_gradient(shell.dof_count(), shell.dof_count());
    for (int dof = 0; dof < shell.dof_count(); ++dof) {
      ShellState ahead = state, behind = state;
      const Eigen::VectorXd unit = Eigen::VectorXd::Unit(shell.dof_count(), dof);
      shell.Step(kStep * unit, ahead);
      shell.Step(-kStep * unit, behind);
      by_energy[dof] =
          (shell.Gradient(ahead, loads, right) - shell.Gradient(behind, loads, left)) / (2 * kStep);
      by_gradient.col(dof) = (right - left) / (2 * kStep);
    }
    EXPECT_LT((by_energy - gradient).norm(), 1e-6 * gradient.norm());
    EXPECT_LT((by_gradient - full).norm(), 1e-6 * full.norm());
  }
};

TEST_P(Derivatives, OfTheElement) {
  const NonlinearShell shell(SmallSurface(), MaterialOf(GetParam()));
  Check(shell, {}, Disturbed(shell, 0.8, 1));
}

TEST_P(Derivatives, OfPressureAndContact) {
  const NonlinearShell shell(SmallSurface(), MaterialOf(GetParam()));
  const FollowerPressure pressure(5e-3);
  RigidContact ball(shell, {.spacing_mm = 2, .stiffness_n_mm3 = 0.5, .sticks = true});
  ball.SetBody(RigidSphere{{47, 5, 10}, 8});
  ball.Hold(Disturbed(shell, 0.4, 3));
  RigidContact stamp(shell, {.spacing_mm = 2, .stiffness_n_mm3 = 0.5});
  stamp.SetBody(RigidStamp{{39, 3, 8}, Vec3(-1, 0.1, 0).normalized(), 3, 1});
  const std::array<const ElementLoad*, 3> loads = {&pressure, &ball, &stamp};
  const ShellState state = Disturbed(shell, 0.8, 2);
  ASSERT_GT(ball.Summarize(state).points, 3);
  ASSERT_GT(stamp.Summarize(state).points, 3);
  Check(shell, loads, state);
}

TEST_P(Derivatives, RigidMotionStoresNothing) {
  const NonlinearShell shell(SmallSurface(), MaterialOf(GetParam()));
  const Eigen::AngleAxisd turn(2.1, Vec3(1, -2, 0.5).normalized());
  ShellState state = shell.Rest();
  for (auto& p : state.mids_mm) p = turn * p + Vec3(3, -20, 8);
  for (auto& d : state.directors) d = turn * d;
  for (auto& t : state.tangents) t = turn * t;
  Eigen::VectorXd gradient;
  EXPECT_LT(shell.Gradient(state, {}, gradient), 1e-20);
  EXPECT_LT(gradient.cwiseAbs().maxCoeff(), 1e-12);
}

INSTANTIATE_TEST_SUITE_P(Laws, Derivatives,
                         ::testing::Values(MaterialLaw::kSaintVenantKirchhoff, MaterialLaw::kNeoHookean),
                         [](const auto& law) {
                           return law.param == MaterialLaw::kNeoHookean ? "NeoHookean"
                                                                        : "SaintVenantKirchhoff";
                         });

}  // namespace
}  // namespace taclink
