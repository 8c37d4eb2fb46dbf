// The neo-Hookean sheet against closed solutions of incompressible elasticity. What comes out:
// docs/reports/shell-benchmarks.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "benchmark_shell.h"

namespace taclink::benchmark {
namespace {

constexpr double kShearModulus = 0.03;
constexpr Material kMaterial{
    .youngs_modulus_mpa = 3 * kShearModulus, .poisson_ratio = 0.5, .law = MaterialLaw::kNeoHookean};
constexpr double kThickness = 2;

// A flat quarter of a sheet, 40 x 30, its inner nodes moved about at random but the same in every run.
class NeoHookeanSheet : public ::testing::Test {
 protected:
  static constexpr double kLength = 40, kWidth = 30;
  static constexpr int kColumns = 5, kRows = 4;

  NeoHookeanSheet() {
    mesh_.AddPatch(kColumns, kRows, [](double u, double v) {
      const double edge = u * (1 - u) * v * (1 - v);  // none at the edges
      return SurfacePoint{{kLength * (u + edge * std::sin(13 * u + 29 * v)),
                           kWidth * (v + edge * std::cos(17 * u - 23 * v)), 0},
                          Vec3::UnitZ()};
    });
    mesh_.FixMirror(0, 0);
    mesh_.FixMirror(1, 0);
    mesh_.Fix(mesh_.NodesWhere([](const Vec3&) { return true; }), {2, 3, 4});
  }

  // Nodes of an edge in order.
  std::vector<int> Edge(int axis, double at) const {
    auto nodes = mesh_.NodesWhere([=](const Vec3& p) { return std::abs(p[axis] - at) < 1e-9; });
    const auto& mids = mesh_.surface().mids_mm;
    std::sort(nodes.begin(), nodes.end(), [&](int a, int b) {
      return mids[static_cast<size_t>(a)][1 - axis] < mids[static_cast<size_t>(b)][1 - axis];
    });
    return nodes;
  }

  // Pulls with nominal stresses; largest distance of a node from where homogeneous stretches take it.
  double ErrorUnder(double stress_x, double stress_y, double stretch_x, double stretch_y) const {
    const NonlinearShell shell(mesh_.surface(), kMaterial);
    NodalLoads loads(shell);
    loads.AddPerLength(Edge(0, kLength), {stress_x * kThickness, 0, 0});
    loads.AddPerLength(Edge(1, kWidth), {0, stress_y * kThickness, 0});
    double worst = 1e300;
    const LoadPath path{.shares = EvenShares(4), .options = {.tolerance_n = 1e-10}};
    FollowLoad(shell, loads.values(), path, [&](double share, const ShellState& state) {
      if (share < 1) return;
      worst = 0;
      for (size_t i = 0; i < state.mids_mm.size(); ++i) {
        const Vec3& rest = shell.surface().mids_mm[i];
        worst =
            std::max(worst, (state.mids_mm[i] - Vec3(stretch_x * rest.x(), stretch_y * rest.y(), 0)).norm());
      }
    });
    return worst;
  }

  SurfaceMesh mesh_{kThickness};
};

TEST_F(NeoHookeanSheet, UniaxialTension) {
  constexpr double kStretch = 1.3;
  const double error =
      ErrorUnder(kShearModulus * (kStretch - std::pow(kStretch, -2)), 0, kStretch, 1 / std::sqrt(kStretch));
  std::printf("uniaxial tension to 1.3: largest error %.1e of %g\n", error, kLength);
  EXPECT_LT(error, 1e-8);
}

TEST_F(NeoHookeanSheet, EquibiaxialTension) {
  constexpr double kStretch = 1.3,
                   kStress = kShearModulus *
                             (kStretch - 1 / (kStretch * kStretch * kStretch * kStretch * kStretch));
  const double error = ErrorUnder(kStress, kStress, kStretch, kStretch);
  std::printf("equibiaxial tension to 1.3: largest error %.1e of %g\n", error, kLength);
  EXPECT_LT(error, 1e-8);
}

// Clamped in width: plane strain.
TEST_F(NeoHookeanSheet, PureShear) {
  constexpr double kStretch = 1.3;
  mesh_.Fix(mesh_.NodesWhere([](const Vec3&) { return true; }), {1});
  const double error = ErrorUnder(kShearModulus * (kStretch - std::pow(kStretch, -3)), 0, kStretch, 1);
  std::printf("pure shear to 1.3: largest error %.1e of %g\n", error, kLength);
  EXPECT_LT(error, 1e-8);
}

// Inflates in steps up to `pressure`; mean stretch of the mid-surface's radius, which is that of the
// coordinates in `across`.
double Inflate(const SurfaceMesh& mesh, double pressure, const Vec3& across) {
  const NonlinearShell shell(mesh.surface(), kMaterial);
  EquilibriumSolver solver(shell, {.tolerance_n = 1e-9, .max_iterations = 100});
  ShellState state = shell.Rest();
  for (const double share : EvenShares(8)) {
    const FollowerPressure load(share * pressure);
    const std::array<const ElementLoad*, 1> loads = {&load};
    const EquilibriumSummary summary = solver.Solve(loads, {}, state);
    EXPECT_TRUE(summary.ok() && summary.stable) << Name(summary.stop);
  }
  double sum = 0;
  for (size_t i = 0; i < state.mids_mm.size(); ++i) {
    sum +=
        state.mids_mm[i].cwiseProduct(across).norm() / shell.surface().mids_mm[i].cwiseProduct(across).norm();
  }
  return sum / static_cast<double>(state.mids_mm.size());
}

// An octant, whose three edges stay in planes through the origin, so that the pressure's potential is exact.
double SphereStretch(double radius, double thickness, int n, double pressure) {
  SurfaceMesh mesh(thickness);
  AddOctant(radius, n, mesh);
  for (const int axis : {0, 1, 2}) mesh.FixMirror(axis, 0);
  return Inflate(mesh, pressure, {1, 1, 1});
}

// A quarter ring in plane strain. The pressure's potential is a third of each coordinate's share of the
// volume; z stands still, so that 3/2 of it are the whole.
double TubeStretch(double radius, double thickness, int n, double pressure) {
  SurfaceMesh mesh(thickness);
  mesh.AddPatch(n, 1, CylinderMap(radius, 0, kPi / 2, 1));
  const auto all = mesh.NodesWhere([](const Vec3&) { return true; });
  mesh.SetTangent(all, Vec3::UnitZ());
  mesh.Fix(all, {2, 4});
  for (const int axis : {0, 1}) {
    mesh.Fix(mesh.NodesWhere([=](const Vec3& p) { return std::abs(p[axis]) < 1e-9; }),
             {static_cast<size_t>(axis), 3});
  }
  return Inflate(mesh, 1.5 * pressure, {1, 1, 0});
}

double ThinSpherePressure(double stretch, double thickness, double radius) {
  return 2 * kShearModulus * thickness / radius * (1 / stretch - std::pow(stretch, -7));
}

// 1.3 is near the largest pressure, at 7^(1/6) = 1.383, so that the stretch answers it strongly.
TEST(NeoHookeanBenchmark, ThinSphere) {
  constexpr double kRadius = 40, kThin = 0.04;
  for (const double stretch : {1.1, 1.2, 1.3}) {
    const double pressure = ThinSpherePressure(stretch, kThin, kRadius);
    char name[64];
    std::snprintf(name, sizeof name, "thin sphere: stretch at p of %.1f", stretch);
    Tabulate(name, "3 x 4 x 4", stretch, SphereStretch(kRadius, kThin, 4, pressure));
    Compare(name, "3 x 8 x 8", stretch, SphereStretch(kRadius, kThin, 8, pressure), 0.005);
  }
}

// Pressure that takes the mid-surface of an incompressible thick wall to `stretch`: the integral over the
// wall of the stress difference over the radius, `dimension` 2 for a tube in plane strain, 3 for a sphere.
double ThickPressure(int dimension, double stretch, double thickness, double radius) {
  const double gain = std::pow(radius, dimension) * (std::pow(stretch, dimension) - 1);
  constexpr int kParts = 400;
  double pressure = 0;
  for (int i = 0; i < kParts; ++i) {
    const double rest = radius + thickness * ((i + 0.5) / kParts - 0.5);
    const double r = std::pow(std::pow(rest, dimension) + gain, 1.0 / dimension), hoop = r / rest;
    const double radial = std::pow(hoop, 1 - dimension);  // dr / d rest, too
    pressure +=
        (dimension - 1) * kShearModulus * (hoop * hoop - radial * radial) / r * radial * thickness / kParts;
  }
  return pressure;
}

// A wall as thick as the skin's, against three-dimensional elasticity. An incompressible wall sweeps the same
// volume at every depth, so that the pressure does on the mid-surface the work that it does on the inner
// wall.
TEST(NeoHookeanBenchmark, ThickWalls) {
  constexpr double kRadius = 38.25, kThick = 3.5;
  for (const double stretch : {1.05, 1.1, 1.2}) {
    const double tube = ThickPressure(2, stretch, kThick, kRadius);
    const double sphere = ThickPressure(3, stretch, kThick, kRadius);
    char part[64];
    std::snprintf(part, sizeof part, ": strain at p of %.2f", stretch - 1);
    Compare(std::string("thick tube") + part, "32 x 1", stretch - 1,
            TubeStretch(kRadius, kThick, 32, tube) - 1, 0.01);
    Compare(std::string("thick sphere") + part, "3 x 8 x 8", stretch - 1,
            SphereStretch(kRadius, kThick, 8, sphere) - 1, 0.01);
  }
}

}  // namespace
}  // namespace taclink::benchmark
