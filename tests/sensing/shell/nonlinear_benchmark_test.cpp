// Sze, Liu and Lo, "Popular benchmark problems for geometric nonlinear analysis of shells", Finite Elements
// in Analysis and Design 40 (2004). What comes out: docs/reports/shell-benchmarks.md.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>

#include "benchmark_shell.h"

namespace taclink::benchmark {
namespace {

constexpr double kNonlinearShare = 0.02;  // of the published value
constexpr double kNonlinearPointShare =
    0.03;  // likewise under a point load on a thin shell (linear_benchmark_test.cpp)

// Published displacements by the share of the whole load, percent.
using Published = std::map<int, double>;

double Moved(const NonlinearShell& shell, const ShellState& state, int node, int axis) {
  const auto i = static_cast<size_t>(node);
  return state.mids_mm[i][axis] - shell.surface().mids_mm[i][axis];
}

// Where something is published for this share; only at the last mesh it is expected.
void RecordAt(bool last, const Published& published, double share, const std::string& name,
              const std::string& mesh, double computed, double allowed = kNonlinearShare) {
  const int percent = static_cast<int>(std::lround(100 * share));
  if (std::abs(percent - 100 * share) > 1e-9 || !published.contains(percent)) return;
  const std::string part = name + ", " + std::to_string(percent) + " %";
  if (last) {
    Compare(part, mesh, published.at(percent), computed, allowed);
  } else {
    Tabulate(part, mesh, published.at(percent), computed);
  }
}

SurfaceMesh Cantilever(double length, double width, double thickness, int elements) {
  SurfaceMesh mesh(thickness);
  mesh.AddPatch(elements, 1,
                [=](double u, double v) { return SurfacePoint{{length * u, width * v, 0}, Vec3::UnitZ()}; });
  mesh.SetTangent(mesh.NodesWhere([](const Vec3&) { return true; }), Vec3::UnitY());
  mesh.Fix(mesh.NodesWhere([](const Vec3& p) { return p.x() == 0; }), {0, 1, 2, 3, 4});
  return mesh;
}

// 3.1: EI / L^2 = 1, end shear 4.
TEST(NonlinearBenchmark, CantileverUnderEndShear) {
  const Published lifted = {{25, 3.015}, {50, 4.933}, {75, 6.031}, {100, 6.698}};
  const Published drawn = {{25, 0.563}, {50, 1.604}, {75, 2.541}, {100, 3.286}};
  const SurfaceMesh mesh = Cantilever(10, 1, 0.1, 16);
  const NonlinearShell shell(mesh.surface(), {1.2e6, 0});
  NodalLoads loads(shell);
  loads.AddPerLength(mesh.NodesWhere([](const Vec3& p) { return p.x() == 10; }), {0, 0, 4});
  const int tip = mesh.NodeAt({10, 0, 0});
  FollowLoad(
      shell, loads.values(), {.shares = EvenShares(4), .options = {.tolerance_n = 1e-6}},
      [&](double share, const ShellState& state) {
        RecordAt(true, lifted, share, "cantilever, end shear: W", "16 x 1", Moved(shell, state, tip, 2));
        RecordAt(true, drawn, share, "cantilever, end shear: -U", "16 x 1", -Moved(shell, state, tip, 0));
      });
}

struct EndMoment {
  double drawn_worst = 0, lifted_worst = 0;  // errors over the beam's length
};

// 3.2: the beam becomes an arc of angle M L / EI, at the end a full circle.
EndMoment RollUp(int elements) {
  constexpr double kLength = 12, kBending = 100, kMoment = 2 * kPi * kBending / kLength;
  const SurfaceMesh mesh = Cantilever(kLength, 1, 0.1, elements);
  const NonlinearShell shell(mesh.surface(), {1.2e6, 0});
  NodalLoads loads(shell);
  const int tip = mesh.NodeAt({kLength, 0, 0});
  for (const int node : {tip, mesh.NodeAt({kLength, 1, 0})}) loads.Add(node, 3, -kMoment / 2);
  EndMoment errors;
  const LoadPath path{
      .shares = EvenShares(20), .options = {.tolerance_n = 1e-6}, .line_search = false, .stable = false};
  FollowLoad(shell, loads.values(), path, [&](double share, const ShellState& state) {
    const double angle = 2 * kPi * share;
    const double drawn = kLength * (1 - std::sin(angle) / angle);
    const double lifted = kLength * (1 - std::cos(angle)) / angle;
    const double u = -Moved(shell, state, tip, 0), w = Moved(shell, state, tip, 2);
    errors.drawn_worst = std::max(errors.drawn_worst, std::abs(u - drawn) / kLength);
    errors.lifted_worst = std::max(errors.lifted_worst, std::abs(w - lifted) / kLength);
    if (std::abs(std::remainder(share, 0.5)) > 1e-9) return;
    const std::string part = ", " + std::to_string(std::lround(100 * share)) + " %";
    Tabulate("cantilever, end moment: -U" + part, MeshName(elements, 1), drawn, u);
  });
  std::printf("end moment, %d elements: largest error of U %.3g L, of W %.3g L\n", elements,
              errors.drawn_worst, errors.lifted_worst);
  return errors;
}

TEST(NonlinearBenchmark, CantileverUnderEndMoment) {
  const EndMoment coarse = RollUp(16), fine = RollUp(32);
  EXPECT_LT(fine.drawn_worst, kNonlinearShare);
  EXPECT_LT(fine.lifted_worst, kNonlinearShare);
  // Second order in the elements' size.
  EXPECT_NEAR(coarse.lifted_worst / fine.lifted_worst, 4, 0.5);
}

// 3.3: clamped at one side of the slit, lifted at the other by 0.8 per length.
TEST(NonlinearBenchmark, SlitAnnularPlate) {
  const Published inner = {{25, 7.602}, {50, 10.468}, {75, 12.310}, {100, 13.891}};
  const Published outer = {{25, 10.288}, {50, 13.768}, {75, 15.842}, {100, 17.528}};
  constexpr int kAcross = 10, kAround = 80;
  SurfaceMesh mesh(0.03);
  // Short of the whole circle by a millionth, so that the two sides of the slit stay two.
  for (const double from : {0.0, 0.5}) {
    mesh.AddPatch(kAcross, kAround / 2, [=](double u, double v) {
      const double angle = 2 * kPi * (from + 0.5 * v) * (1 - 1e-6), r = 6 + 4 * u;
      return SurfacePoint{{r * std::cos(angle), r * std::sin(angle), 0}, Vec3::UnitZ()};
    });
  }
  mesh.Fix(mesh.NodesWhere([](const Vec3& p) { return p.x() > 0 && p.y() == 0; }), {0, 1, 2, 3, 4});
  const auto lifted = mesh.NodesWhere([](const Vec3& p) { return p.x() > 0 && p.y() < 0 && p.y() > -1e-3; });
  ASSERT_EQ(lifted.size(), kAcross + 1);
  const NonlinearShell shell(mesh.surface(), {21e6, 0});
  NodalLoads loads(shell);
  loads.AddPerLength(lifted, {0, 0, 0.8});
  const LoadPath path{.shares = EvenShares(20), .options = {.tolerance_n = 1e-6}, .line_search = false};
  FollowLoad(shell, loads.values(), path, [&](double share, const ShellState& state) {
    const std::string size = MeshName(kAcross, kAround);
    RecordAt(true, inner, share, "slit annular plate: W_A", size, Moved(shell, state, lifted.front(), 2));
    RecordAt(true, outer, share, "slit annular plate: W_B", size, Moved(shell, state, lifted.back(), 2));
  });
}

// 3.4: a quarter; 200 on it are 400 on the whole.
void PullHemisphere(int n, bool last) {
  const Published pulled = {{25, 2.596}, {50, 3.406}, {75, 3.816}, {100, 4.067}};
  const Published pushed = {{25, 3.833}, {50, 5.902}, {75, 7.234}, {100, 8.178}};
  SurfaceMesh mesh(0.04);
  mesh.AddPatch(n, n, SphereMap(10, RadFromDeg(72)));
  mesh.FixMirror(0, 0);
  mesh.FixMirror(1, 0);
  const int a = mesh.NodeAt({0, 10, 0}), b = mesh.NodeAt({10, 0, 0});
  mesh.Fix({b}, {2});
  const NonlinearShell shell(mesh.surface(), {6.825e7, 0.3});
  NodalLoads loads(shell);
  loads.Add(a, {0, 200, 0});
  loads.Add(b, {-200, 0, 0});
  const LoadPath path{.shares = EvenShares(20), .options = {.tolerance_n = 1e-5}, .line_search = false};
  FollowLoad(shell, loads.values(), path, [&](double share, const ShellState& state) {
    RecordAt(last, pulled, share, "hemisphere with hole: outwards", MeshName(n, n),
             Moved(shell, state, a, 1));
    RecordAt(last, pushed, share, "hemisphere with hole: inwards", MeshName(n, n),
             -Moved(shell, state, b, 0));
  });
}

TEST(NonlinearBenchmark, HemisphereWithHole) {
  PullHemisphere(16, false);
  PullHemisphere(32, true);
}

// 3.5: an octant, pulled along x in the middle of the length; B is a quarter around from there, C at the end.
TEST(NonlinearBenchmark, PulledOutCylinder) {
  const Published w_a = {{25, 2.180}, {50, 2.473}, {75, 2.692}, {100, 2.768}};
  const Published u_b = {{25, 3.087}, {50, 3.653}, {75, 4.423}, {100, 4.551}};
  const Published u_c = {{25, 3.310}, {50, 3.718}, {75, 3.353}, {100, 3.269}};
  constexpr double kRadius = 4.953, kHalf = 10.35 / 2;
  constexpr int kAlong = 24, kAround = 36;
  SurfaceMesh mesh(0.094);
  mesh.AddPatch(kAround, kAlong, CylinderMap(kRadius, 0, kPi / 2, kHalf));
  for (const int axis : {0, 1, 2}) mesh.FixMirror(axis, 0);
  const NonlinearShell shell(mesh.surface(), {10.5e6, 0.3125});
  NodalLoads loads(shell);
  const int a = mesh.NodeAt({kRadius, 0, 0}), b = mesh.NodeAt({0, kRadius, 0}),
            c = mesh.NodeAt({0, kRadius, kHalf});
  loads.Add(a, {10e3, 0, 0});
  const LoadPath path{.shares = EvenShares(20), .options = {.tolerance_n = 1e-3, .max_step_mm = 0.5}};
  FollowLoad(shell, loads.values(), path, [&](double share, const ShellState& state) {
    const std::string size = MeshName(kAlong, kAround);
    RecordAt(true, w_a, share, "pulled-out cylinder: W_A", size, Moved(shell, state, a, 0));
    RecordAt(true, u_b, share, "pulled-out cylinder: -U_B", size, -Moved(shell, state, b, 1));
    RecordAt(true, u_c, share, "pulled-out cylinder: -U_C", size, -Moved(shell, state, c, 1));
  });
}

// 3.6: an octant, pinched in the middle of the length, rigid diaphragm at z = 0. It buckles on the way. U_B
// comes out up to 8 % above what is published, as with another program's shell: shown only.
TEST(NonlinearBenchmark, PinchedCylinder) {
  const Published w_a = {{10, 23.164}, {25, 61.877}, {50, 73.790}, {75, 79.339}, {100, 83.102}};
  const Published u_b = {{25, 14.905}, {50, 25.381}, {75, 30.604}, {100, 34.272}};
  constexpr int kSide = 48;
  SurfaceMesh mesh(1);
  mesh.AddPatch(kSide, kSide, CylinderMap(100, 0, kPi / 2, 100));
  mesh.Fix(mesh.NodesWhere([](const Vec3& p) { return p.z() == 0; }), {0, 1});
  mesh.FixMirror(0, 0);
  mesh.FixMirror(1, 0);
  mesh.FixMirror(2, 100);
  const NonlinearShell shell(mesh.surface(), {30e3, 0.3});
  NodalLoads loads(shell);
  const int a = mesh.NodeAt({100, 0, 100}), b = mesh.NodeAt({0, 100, 100});
  loads.Add(a, {-3000, 0, 0});
  const LoadPath path{.shares = EvenShares(20), .options = {.tolerance_n = 1e-3, .max_iterations = 200}};
  FollowLoad(shell, loads.values(), path, [&](double share, const ShellState& state) {
    const std::string size = MeshName(kSide, kSide);
    RecordAt(true, w_a, share, "pinched cylinder, diaphragms: -W_A", size, -Moved(shell, state, a, 0),
             kNonlinearPointShare);
    RecordAt(false, u_b, share, "pinched cylinder, diaphragms: U_B", size, Moved(shell, state, b, 1));
  });
}

// 3.7: half of it; clamped at z = 0, no motion along y and no rotation about z on the straight edge, pushed
// at the crown of the free end.
TEST(NonlinearBenchmark, PinchedSemiCylinder) {
  const Published w_a = {{25, 48.537}, {50, 132.653}, {75, 156.584}, {100, 171.505}};
  constexpr double kRadius = 101.6, kLength = 304.8;
  constexpr int kSide = 24;
  SurfaceMesh mesh(3);
  mesh.AddPatch(kSide, kSide, CylinderMap(kRadius, 0, kPi / 2, kLength));
  const auto edge = mesh.NodesWhere([](const Vec3& p) { return p.y() == 0; });
  mesh.SetTangent(edge, Vec3::UnitZ());
  mesh.Fix(edge, {1, 3});
  mesh.Fix(mesh.NodesWhere([](const Vec3& p) { return p.z() == 0; }), {0, 1, 2, 3, 4});
  mesh.FixMirror(0, 0);
  const NonlinearShell shell(mesh.surface(), {2068.5, 0.3});
  NodalLoads loads(shell);
  const int a = mesh.NodeAt({0, kRadius, kLength});
  loads.Add(a, {0, -1000, 0});
  const LoadPath path{.shares = EvenShares(20),
                      .options = {.tolerance_n = 1e-4, .max_iterations = 200, .max_step_mm = 20}};
  FollowLoad(shell, loads.values(), path, [&](double share, const ShellState& state) {
    RecordAt(true, w_a, share, "pinched semi-cylinder: -W_A", MeshName(kSide, kSide),
             -Moved(shell, state, a, 1));
  });
}

// 3.8: a quarter, 12.7 thick, hinged at its straight edges, pushed at the crown through its limit point.
TEST(NonlinearBenchmark, HingedRoof) {
  // Deflection and share of 3000.
  const std::vector<std::pair<double, double>> published = {
      {1.638, 0.1980},  {4.477, 0.4686},  {7.057, 0.6381},  {10.358, 0.7412}, {12.903, 0.7023},
      {15.676, 0.4442}, {18.299, 0.1940}, {19.852, 0.1729}, {22.875, 0.2950}, {27.276, 0.7551}};
  constexpr double kRadius = 2540, kHalfAngle = 0.1, kHalfLength = 254;
  constexpr int kSide = 16;
  SurfaceMesh mesh(12.7);
  mesh.AddPatch(kSide, kSide, CylinderMap(kRadius, 0, kHalfAngle, kHalfLength));
  const double edge = kRadius * std::sin(kHalfAngle);
  mesh.Fix(mesh.NodesWhere([=](const Vec3& p) { return p.y() > edge - 1e-6; }), {0, 1, 2});
  mesh.FixMirror(1, 0);
  mesh.FixMirror(2, 0);
  std::vector<double> values;
  values.reserve(published.size());
  for (const auto& [deflection, share] : published) values.push_back(-deflection);
  size_t next = 0;
  FollowDisplacement(mesh.surface(), {3102.75, 0.3}, mesh.NodeAt({kRadius, 0, 0}), 0, values,
                     {.tolerance_n = 1e-5}, [&](double value, double force) {
                       char name[64];
                       std::snprintf(name, sizeof name, "hinged roof: P at -W = %.3f", -value);
                       Compare(name, MeshName(kSide, kSide), 3000 * published[next++].second, -4 * force,
                               kNonlinearShare);
                     });
  EXPECT_EQ(next, published.size());
}

}  // namespace
}  // namespace taclink::benchmark
