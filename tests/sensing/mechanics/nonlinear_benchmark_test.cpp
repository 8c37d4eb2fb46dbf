// Sze, Liu and Lo, "Popular benchmark problems for geometric nonlinear analysis of shells", Finite Elements
// in Analysis and Design 40 (2004). What comes out: docs/shell-benchmarks.md.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <map>

#include "benchmark_shell.h"

namespace taclink::benchmark {
namespace {

constexpr double kShare = 0.02;  // of the published value

// Published displacements by the share of the whole load, percent.
using Published = std::map<int, double>;

double Moved(const NonlinearShell& shell, const ShellState& state, int node, int axis) {
  const auto i = static_cast<size_t>(node);
  return state.mids_mm[i][axis] - shell.surface().mids_mm[i][axis];
}

// Compares where something is published for this share.
void CompareAt(const Published& published, double share, const std::string& name, const std::string& mesh,
               double computed, double within = kShare) {
  const int percent = static_cast<int>(std::lround(100 * share));
  if (std::abs(percent - 100 * share) > 1e-9 || !published.contains(percent)) return;
  Compare(name + ", " + std::to_string(percent) + " %", mesh, published.at(percent), computed, within);
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
  FollowLoad(shell, loads.values(), EvenShares(4), {.tolerance_n = 1e-6}, true,
             [&](double share, const ShellState& state) {
               CompareAt(lifted, share, "cantilever, end shear: W", "16 x 1", Moved(shell, state, tip, 2));
               CompareAt(drawn, share, "cantilever, end shear: -U", "16 x 1", -Moved(shell, state, tip, 0));
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
  FollowLoad(shell, loads.values(), EvenShares(20), {.tolerance_n = 1e-6}, false,
             [&](double share, const ShellState& state) {
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
  EXPECT_LT(fine.drawn_worst, kShare);
  EXPECT_LT(fine.lifted_worst, kShare);
  // Second order in the elements' size.
  EXPECT_NEAR(coarse.lifted_worst / fine.lifted_worst, 4, 0.5);
}

// 3.3: clamped at one side of the slit, lifted at the other by 0.8 per length.
TEST(NonlinearBenchmark, SlitAnnularPlate) {
  const Published inner = {{25, 7.602}, {50, 10.468}, {75, 12.310}, {100, 13.891}};
  const Published outer = {{25, 10.288}, {50, 13.768}, {75, 15.842}, {100, 17.528}};
  constexpr int kAcross = 10, kAround = 80;
  SurfaceMesh mesh(0.03);
  // Open at the slit: one point less than the whole circle, so that the two sides don't become one.
  std::vector<int> lifted;
  for (const auto& [from, to] : {std::pair(0.0, 0.5), std::pair(0.5, 1.0)}) {
    mesh.AddPatch(kAcross, kAround / 2, [=](double u, double v) {
      const double angle = 2 * kPi * (from + (to - from) * v) * (1 - 1e-6), r = 6 + 4 * u;
      return SurfacePoint{{r * std::cos(angle), r * std::sin(angle), 0}, Vec3::UnitZ()};
    });
  }
  mesh.Fix(mesh.NodesWhere([](const Vec3& p) { return p.x() > 0 && p.y() == 0; }), {0, 1, 2, 3, 4});
  lifted = mesh.NodesWhere([](const Vec3& p) { return p.x() > 0 && p.y() < 0 && p.y() > -1e-3; });
  ASSERT_EQ(lifted.size(), kAcross + 1);
  const NonlinearShell shell(mesh.surface(), {21e6, 0});
  NodalLoads loads(shell);
  loads.AddPerLength(lifted, {0, 0, 0.8});
  FollowLoad(
      shell, loads.values(), EvenShares(20), {.tolerance_n = 1e-6, .max_iterations = 200}, true,
      [&](double share, const ShellState& state) {
        const std::string size = MeshName(kAcross, kAround);
        CompareAt(inner, share, "slit annular plate: W_A", size, Moved(shell, state, lifted.front(), 2));
        CompareAt(outer, share, "slit annular plate: W_B", size, Moved(shell, state, lifted.back(), 2));
      });
}

// 3.4: a quarter; 200 on it are 400 on the whole.
TEST(NonlinearBenchmark, HemisphereWithHole) {
  const Published pulled = {{25, 2.596}, {50, 3.406}, {75, 3.816}, {100, 4.067}};
  const Published pushed = {{25, 3.833}, {50, 5.902}, {75, 7.234}, {100, 8.178}};
  constexpr int kSide = 16;
  SurfaceMesh mesh(0.04);
  mesh.AddPatch(kSide, kSide, SphereMap(10, RadFromDeg(72)));
  mesh.FixMirror(0, 0);
  mesh.FixMirror(1, 0);
  const int a = mesh.NodeAt({0, 10, 0}), b = mesh.NodeAt({10, 0, 0});
  mesh.Fix({b}, {2});
  const NonlinearShell shell(mesh.surface(), {6.825e7, 0.3});
  NodalLoads loads(shell);
  loads.Add(a, {0, 200, 0});
  loads.Add(b, {-200, 0, 0});
  FollowLoad(shell, loads.values(), EvenShares(20), {.tolerance_n = 1e-5, .max_iterations = 200}, true,
             [&](double share, const ShellState& state) {
               const std::string size = MeshName(kSide, kSide);
               CompareAt(pulled, share, "hemisphere with hole: outwards", size, Moved(shell, state, a, 1));
               CompareAt(pushed, share, "hemisphere with hole: inwards", size, -Moved(shell, state, b, 0));
             });
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
  for (const auto& [axis, at] : {std::pair(0, 0.0), std::pair(1, 0.0), std::pair(2, 0.0)}) {
    mesh.FixMirror(axis, at);
  }
  const NonlinearShell shell(mesh.surface(), {10.5e6, 0.3125});
  NodalLoads loads(shell);
  const int a = mesh.NodeAt({kRadius, 0, 0}), b = mesh.NodeAt({0, kRadius, 0}),
            c = mesh.NodeAt({0, kRadius, kHalf});
  loads.Add(a, {10e3, 0, 0});
  FollowLoad(shell, loads.values(), EvenShares(40),
             {.tolerance_n = 1e-3, .max_iterations = 300, .max_step_mm = 0.5}, true,
             [&](double share, const ShellState& state) {
               const std::string size = MeshName(kAlong, kAround);
               CompareAt(w_a, share, "pulled-out cylinder: W_A", size, Moved(shell, state, a, 0));
               CompareAt(u_b, share, "pulled-out cylinder: -U_B", size, -Moved(shell, state, b, 1));
               CompareAt(u_c, share, "pulled-out cylinder: -U_C", size, -Moved(shell, state, c, 1));
             });
}

}  // namespace
}  // namespace taclink::benchmark
