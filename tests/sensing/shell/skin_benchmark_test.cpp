// The shipped skins: energy, reciprocity, and the linear shell as the limit of small loads.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>

#include "benchmark_shell.h"
#include "sensing/model/model_file.h"
#include "sensing/shell/linear_shell.h"
#include "sensing/shell/rigid_contact.h"

namespace taclink::benchmark {
namespace {

struct Case {
  const char* model;
  MaterialLaw law;
};

class Skin : public ::testing::TestWithParam<Case> {
 protected:
  static LinkModel Model() {
    LinkModel model = LoadLinkModel(GetParam().model).value();
    model.material.youngs_modulus_mpa =
        0.1;  // the table of docs/reports/shell-benchmarks.md, whatever is shipped
    model.material.law = GetParam().law;
    if (GetParam().law == MaterialLaw::kNeoHookean) model.material.poisson_ratio = 0.5;
    return model;
  }

  // Two nodes away from the clamped ends and from each other.
  int NodeA() const { return mesh_.Node(1, mesh_.rows / 2); }
  int NodeB() const { return mesh_.Node(4, mesh_.rows / 3); }

  Eigen::VectorXd ForceOn(int node, const Vec3& force) const {
    NodalLoads loads(shell_);
    loads.Add(node, force);
    return loads.values();
  }
  // Inwards and along the axis.
  Eigen::VectorXd Dent() const {
    const Vec3 normal = mesh_.normals[static_cast<size_t>(NodeA())];
    return ForceOn(NodeA(), -0.35 * normal + Vec3(0, 0, 0.03));
  }
  Vec3 MotionOf(const ShellState& state, int node) const {
    const auto i = static_cast<size_t>(node);
    return state.mids_mm[i] - mesh_.mid_mm[i];
  }
  double Volume(const ShellState& state) const {
    const FollowerPressure unit(1);
    const std::array<const ElementLoad*, 1> loads = {&unit};
    return shell_.Energy(state, {}) - shell_.Energy(state, loads);
  }
  // From `state` to the equilibrium under shares of the dent and of the pressure.
  void SolveAt(double dent_share, double pressure_share, ShellState& state) {
    const FollowerPressure pressure(pressure_share * kPressure);
    const std::array<const ElementLoad*, 1> loads = {&pressure};
    const EquilibriumSummary summary = solver_.Solve(loads, dent_share * Dent(), state);
    ASSERT_TRUE(summary.ok() && summary.stable) << Name(summary.stop);
  }

  static constexpr double kPressure = 1e-3;
  const LinkModel model_ = Model();
  const ShellMesh mesh_ = MakeShellMesh(model_, 1);
  const NonlinearShell shell_{SkinSurface(mesh_), model_.material};
  EquilibriumSolver solver_{shell_, {.tolerance_n = 1e-9, .max_iterations = 200}};
};

// Dent and pressure rise together, s from 0 to 1: their work is what is stored. By parts, it is the whole
// force times the whole way less the integral of the way over s (8 Gauss points in each half).
TEST_P(Skin, WorkOfTheLoadsIsStored) {
  constexpr std::array<double, 4> kAt = {0.1834346424956498, 0.5255324099163290, 0.7966664774136267,
                                         0.9602898564975363};
  constexpr std::array<double, 4> kWeight = {0.3626837833783620, 0.3137066458778873, 0.2223810344533745,
                                             0.1012285362903763};
  const Eigen::VectorXd dent = Dent();
  const double rest_volume = Volume(shell_.Rest());
  const auto way = [&](const ShellState& state) {
    double sum = kPressure * (Volume(state) - rest_volume);
    for (int c = 0; c < 3; ++c) sum += dent[shell_.Dof(NodeA(), c)] * MotionOf(state, NodeA())[c];
    return sum;
  };
  ShellState state = shell_.Rest();
  double integral = 0;
  constexpr int kParts = 2;
  for (int part = 0; part < kParts; ++part) {
    for (int i = 0; i < 8; ++i) {
      const auto k = static_cast<size_t>(i < 4 ? 3 - i : i - 4);
      const double share = (part + (1 + (i < 4 ? -1 : 1) * kAt[k]) / 2) / kParts;
      SolveAt(share, share, state);
      integral += kWeight[k] / (2 * kParts) * way(state);
    }
  }
  SolveAt(1, 1, state);
  const double work = way(state) - integral, stored = shell_.Energy(state, {});
  ShellState inflated = shell_.Rest();
  SolveAt(0, 1, inflated);
  const double dent_mm = (MotionOf(state, NodeA()) - MotionOf(inflated, NodeA())).norm();
  std::printf("%s: dent of %.2f mm, work %.9g N mm, stored %.9g, ratio - 1 %.1e\n", GetParam().model, dent_mm,
              work, stored, work / stored - 1);
  EXPECT_GT(dent_mm, mesh_.thickness_mm);  // far from linear
  EXPECT_NEAR(work / stored, 1, 1e-8);
}

TEST_P(Skin, OrderOfTheLoadsDoesNotMatter) {
  ShellState dent_first = shell_.Rest(), pressure_first = shell_.Rest();
  SolveAt(1, 0, dent_first);
  SolveAt(1, 1, dent_first);
  SolveAt(0, 1, pressure_first);
  SolveAt(1, 1, pressure_first);
  double apart = 0;
  for (size_t i = 0; i < dent_first.mids_mm.size(); ++i) {
    apart = std::max(apart, (dent_first.mids_mm[i] - pressure_first.mids_mm[i]).norm());
  }
  std::printf("%s: %.1e mm apart\n", GetParam().model, apart);
  EXPECT_LT(apart, 1e-6);
}

// One node's answer to a force on the other, and the other way round, at rest and where the skin is dented
// and inflated.
TEST_P(Skin, TangentComplianceIsSymmetric) {
  const FollowerPressure pressure(kPressure);
  const std::array<const ElementLoad*, 1> loads = {&pressure};
  ShellState loaded = shell_.Rest();
  SolveAt(1, 1, loaded);
  for (const ShellState& state : {shell_.Rest(), loaded}) {
    Mat3 a_by_b, b_by_a;
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::VectorXd by_a = TangentResponse(shell_, state, loads, ForceOn(NodeA(), Vec3::Unit(axis)));
      const Eigen::VectorXd by_b = TangentResponse(shell_, state, loads, ForceOn(NodeB(), Vec3::Unit(axis)));
      for (int c = 0; c < 3; ++c) {
        b_by_a(c, axis) = by_a[shell_.Dof(NodeB(), c)];
        a_by_b(c, axis) = by_b[shell_.Dof(NodeA(), c)];
      }
    }
    EXPECT_LT((a_by_b - b_by_a.transpose()).norm(), 1e-10 * a_by_b.norm());
  }
}

// The same for solved equilibria: forces up and down, so that the answer's curvature falls out.
TEST_P(Skin, SolvedEquilibriaAreReciprocal) {
  const FollowerPressure pressure(kPressure);
  const std::array<const ElementLoad*, 1> loads = {&pressure};
  ShellState start = shell_.Rest();
  SolveAt(1, 1, start);
  EquilibriumSolver solver(shell_, {.tolerance_n = 1e-12, .max_iterations = 20});
  const Vec3 at_a(1, -2, 0.5), at_b(0.3, 1, -1);
  constexpr double kForce = 1e-5;
  const auto answer = [&](int loaded, const Vec3& force, int seen) {
    std::array<Vec3, 2> ends;
    for (const int sign : {-1, 1}) {
      ShellState state = start;
      solver.Solve(loads, Dent() + ForceOn(loaded, sign * kForce * force), state);
      ends[sign > 0] = MotionOf(state, seen);
    }
    return Vec3((ends[1] - ends[0]) / (2 * kForce));
  };
  const double a_on_b = at_b.dot(answer(NodeA(), at_a, NodeB()));
  const double b_on_a = at_a.dot(answer(NodeB(), at_b, NodeA()));
  std::printf("%s: %.10g and %.10g mm/N, apart %.1e\n", GetParam().model, a_on_b, b_on_a,
              std::abs(a_on_b / b_on_a - 1));
  EXPECT_NEAR(a_on_b / b_on_a, 1, 1e-8);
}

TEST_P(Skin, SmallLoadsGiveTheLinearShell) {
  const LinearShell linear(model_, 1);
  const NodalLoad load{NodeA(), Vec3(0.1, -0.2, 0.3)};
  const ShellDisplacement expected = linear.Solve({&load, 1});
  const Eigen::VectorXd found = TangentResponse(shell_, shell_.Rest(), {}, ForceOn(load.node, load.force_n));
  double apart = 0, largest = 0;
  for (int node = 0; node < mesh_.node_count(); ++node) {
    if (mesh_.IsClamped(node)) continue;
    const Vec3& u = expected.translations_mm[static_cast<size_t>(node)];
    largest = std::max(largest, u.norm());
    apart = std::max(apart, (found.segment<3>(shell_.Dof(node, 0)) - u).norm());
  }
  std::printf("%s: %.1e of the largest displacement\n", GetParam().model, apart / largest);
  EXPECT_LT(apart, 1e-9 * largest);
}

// A ball pressed 15 mm deep between nodes, in few steps and in many: the same branch of equilibria. Elements
// next to the ball are compressed until some rotations' own stiffness all but vanishes.
TEST(SkinContact, LargeStepsEndWhereSmallOnesDo) {
  LinkModel model = LoadLinkModel("cylinder").value();
  model.material = {.youngs_modulus_mpa = 0.1, .poisson_ratio = 0.5, .law = MaterialLaw::kNeoHookean};
  const ShellMesh mesh = MakeShellMesh(model, 1);
  const NonlinearShell shell(SkinSurface(mesh), model.material);
  const double angle = model.PathAngle(0) + model.markers.path_pitch_rad() / 2;
  const Vec3 out(std::cos(angle), std::sin(angle), 0);
  const auto press = [&](int steps) {
    RigidContact contact(shell,
                         {.offset_mm = model.thickness_mm / 2, .spacing_mm = 1, .stiffness_n_mm3 = 0.05});
    const std::array<const ElementLoad*, 1> loads = {&contact};
    EquilibriumSolver solver(shell, {.tolerance_n = 1e-7, .max_iterations = 100});
    ShellState state = shell.Rest();
    for (const double share : EvenShares(steps)) {
      contact.SetBody(RigidSphere{(40 + 10 - 15 * share) * out + Vec3(0, 0, 108), 10});
      const EquilibriumSummary summary = solver.Solve(loads, {}, state);
      EXPECT_TRUE(summary.ok() && summary.stable) << Name(summary.stop) << " at " << 15 * share << " mm";
    }
    return contact.Summarize(state).force_n.norm();
  };
  const double in_many = press(30);
  std::printf("15 mm deep: %.6f N\n", in_many);
  for (const int steps : {3, 6}) EXPECT_NEAR(press(steps), in_many, 1e-5) << steps << " steps";
}

INSTANTIATE_TEST_SUITE_P(Benchmark, Skin,
                         ::testing::Values(Case{"cylinder", MaterialLaw::kSaintVenantKirchhoff},
                                           Case{"cylinder", MaterialLaw::kNeoHookean},
                                           Case{"barrel", MaterialLaw::kNeoHookean}),
                         [](const auto& skin) {
                           return std::string(skin.param.model) + (skin.param.law == MaterialLaw::kNeoHookean
                                                                       ? "NeoHookean"
                                                                       : "SaintVenantKirchhoff");
                         });

}  // namespace
}  // namespace taclink::benchmark
