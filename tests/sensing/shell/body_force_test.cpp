// Weight against beam theory and its own sum.
#include "sensing/shell/body_force.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "sensing/model/model_file.h"
#include "sensing/shell/equilibrium.h"

namespace taclink {
namespace {

// A cylinder of other length, with a ring of markers every 18 mm, for the mesh follows these.
LinkModel Tube(double length_mm) {
  LinkModel model = LoadLinkModel("cylinder").value();
  model.length_mm = length_mm;
  model.markers.rings_z_mm.clear();
  for (double z = 18; z < length_mm - 9; z += 18) model.markers.rings_z_mm.push_back(z);
  return model;
}

TEST(BodyForceTest, SumsUpToTheWholeSkinsWeight) {
  const LinkModel model = Tube(198);
  const ShellSurface surface = SkinSurface(MakeShellMesh(model, 3));
  double area_mm2 = 0;
  for (const Eigen::Vector4d& shares : CornerAreas(surface)) {
    EXPECT_GT(shares.minCoeff(), 0);
    area_mm2 += shares.sum();
  }
  const double radius_mm = model.PointAtDepth(0, 99, model.thickness_mm / 2).x();
  EXPECT_NEAR(area_mm2, 2 * kPi * radius_mm * model.length_mm, 1e-3 * area_mm2);
  // As an independent program has it (docs/reports/calculix.md): 0.178 kg.
  EXPECT_NEAR(model.MassPerArea() * area_mm2, 0.178, 1e-3);
}

TEST(BodyForceTest, IsTheDerivativeOfItsEnergy) {
  const LinkModel model = Tube(198);
  const NonlinearShell shell(SkinSurface(MakeShellMesh(model, 1)), model.material);
  const std::vector<Eigen::Vector4d> areas_mm2 = CornerAreas(shell.surface());
  const BodyForce force(areas_mm2, Vec3(1e-5, -2e-5, 3e-5));
  const ElementLoad* loads[] = {&force};
  const auto energy = [&](const ShellState& state) {
    return shell.Energy(state, loads) - shell.Energy(state, {});
  };
  Eigen::VectorXd with, without;
  const ShellState rest = shell.Rest();
  shell.Gradient(rest, loads, with);
  shell.Gradient(rest, {}, without);
  for (const int dof : {0, 1, 2, 3, 4, 501, 502, 503}) {
    ShellState moved = rest;
    shell.Step(Eigen::VectorXd::Unit(shell.dof_count(), dof), moved);
    // Linear in the displacements: exact for a step of any length.
    const double by_energy = dof % 5 < 3 ? energy(moved) - energy(rest) : 0;
    EXPECT_NEAR((with - without)[dof], by_energy, 1e-9) << dof;
  }
}

// A tube clamped at both ends, under its weight: bending w L^4 / 384 E I and shear w L^2 / 8 k G A
// [timoshenko1921] with k = 1/2 of a thin tube, which is long enough not to become oval, and far from its
// large displacements.
TEST(BodyForceTest, SagsLikeABeam) {
  const LinkModel model = Tube(594);
  const NonlinearShell shell(SkinSurface(MakeShellMesh(model, 2)), model.material);
  const std::vector<Eigen::Vector4d> areas_mm2 = CornerAreas(shell.surface());
  const double share = 1e-2;  // of gravity
  const double n_per_mm2 = share * 9.80665 * model.MassPerArea();
  const BodyForce weight(areas_mm2, Vec3(0, -n_per_mm2, 0));
  const ElementLoad* loads[] = {&weight};
  ShellState state = shell.Rest();
  EquilibriumSolver solver(shell, {.tolerance_n = 1e-9, .max_iterations = 200});
  ASSERT_TRUE(solver.Solve(loads, {}, state).ok());
  double sum_mm = 0, count = 0;
  for (size_t i = 0; i < state.mids_mm.size(); ++i) {
    const Vec3& rest = shell.surface().mids_mm[i];
    if (std::abs(rest.z() - model.length_mm / 2) > 9.1) continue;
    sum_mm += rest.y() - state.mids_mm[i].y();
    ++count;
  }
  const double e = model.material.youngs_modulus_mpa, t = model.thickness_mm, l = model.length_mm;
  const double r = model.PointAtDepth(0, l / 2, t / 2).x();
  const double w = 2 * kPi * r * n_per_mm2;
  const double bending_mm = w * std::pow(l, 4) / (384 * e * kPi * r * r * r * t);
  const double shear_mm = w * l * l / (8 * 0.5 * e / 3 * 2 * kPi * r * t);
  EXPECT_NEAR(sum_mm / count, bending_mm + shear_mm, 0.05 * (bending_mm + shear_mm));
}

}  // namespace
}  // namespace taclink
