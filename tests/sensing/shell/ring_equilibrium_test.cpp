// Equilibria that are found with the untouched skin's stiffness alone, against Newton's method with a Hessian
// in each step.
#include "sensing/shell/ring_equilibrium.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "sensing/model/model_file.h"
#include "sensing/shell/equilibrium.h"
#include "sensing/shell/inflated_skin.h"
#include "sensing/shell/shell_mesh.h"

namespace taclink {
namespace {

double LongestOff(const ShellState& a, const ShellState& b) {
  double longest = 0;
  for (size_t i = 0; i < a.mids_mm.size(); ++i)
    longest =
        std::max({longest, (a.mids_mm[i] - b.mids_mm[i]).norm(), (a.directors[i] - b.directors[i]).norm()});
  return longest;
}

class SkinUnderPressure {
 public:
  explicit SkinUnderPressure(const char* model)
      : model_(LoadLinkModel(model).value()),
        shell_(SkinSurface(MakeShellMesh(model_, MeshRefinement{1, 2})), model_.material) {}

  const NonlinearShell& shell() const { return shell_; }
  ShellState InSteps(double pressure_mpa) {
    EquilibriumSolver solver(shell_, {.tolerance_n = 1e-10});
    ShellState state = shell_.Rest();
    for (int step = 1; step <= 10; ++step) {
      const FollowerPressure pressure(pressure_mpa * step / 10);
      const ElementLoad* loads[] = {&pressure};
      EXPECT_TRUE(solver.Solve(loads, {}, state).ok());
    }
    return state;
  }
  // Inward, spread over a node and its neighbors around, N.
  Eigen::VectorXd Push(int row, int column, double force_n) const {
    Eigen::VectorXd load = Eigen::VectorXd::Zero(shell_.dof_count());
    for (const auto& [beside, share] : {std::pair(-1, 0.25), {0, 0.5}, {1, 0.25}}) {
      const int node = row * shell_.rings()->columns() + column + beside;
      const Vec3 inward = -shell_.surface().directors[static_cast<size_t>(node)];
      load.segment<3>(shell_.Dof(node, 0)) = share * force_n * inward;
    }
    return load;
  }

 private:
  LinkModel model_;
  NonlinearShell shell_;
};

class InflatedSkinsTest : public ::testing::TestWithParam<const char*> {};

TEST_P(InflatedSkinsTest, IsTheEquilibriumUnderPressure) {
  SkinUnderPressure skin(GetParam());
  for (const double pressure_mpa : {0.0, 5e-5, 2e-4, 1.5e-3}) {
    const auto inflated = Inflate(skin.shell(), pressure_mpa);
    ASSERT_TRUE(inflated.has_value()) << pressure_mpa;
    EXPECT_LT(LongestOff(inflated->state, skin.InSteps(pressure_mpa)), 1e-6) << pressure_mpa;
  }
}

TEST_P(InflatedSkinsTest, DoesNotStandSuction) {
  const SkinUnderPressure skin(GetParam());
  EXPECT_FALSE(Inflate(skin.shell(), -2e-3).has_value());
}

INSTANTIATE_TEST_SUITE_P(Skins, InflatedSkinsTest,
                         ::testing::Values("cylinder", "barrel", "bottle", "cone", "third", "triple"));

TEST(RingEquilibriumTest, IsThatOfNewtonsMethod) {
  for (const auto& [name, pressure_mpa, force_n] :
       {std::tuple("cylinder", 1e-3, 0.6), {"barrel", 5e-4, 0.3}, {"cylinder", 0.0, 0.05}}) {
    const SkinUnderPressure skin(name);
    const auto inflated = Inflate(skin.shell(), pressure_mpa);
    ASSERT_TRUE(inflated.has_value());
    const FollowerPressure pressure(pressure_mpa);
    const ElementLoad* loads[] = {&pressure};
    const Eigen::VectorXd push = skin.Push(9, 5, force_n);
    ShellState state = inflated->state, expected = state;
    EquilibriumSolver newton(skin.shell(), {.tolerance_n = 1e-10});
    ASSERT_TRUE(newton.Solve(loads, push, expected).ok());
    RingEquilibrium solver(skin.shell());
    const auto summary = solver.Solve(inflated->stiffness, loads, push, state);
    EXPECT_TRUE(summary.converged);
    EXPECT_LT(summary.evaluations, 30);
    EXPECT_LT(LongestOff(state, expected), 1e-3) << name;
    EXPECT_GT(LongestOff(expected, inflated->state), 1.5) << name;

    const Eigen::VectorXd small = 1e-4 * skin.Push(12, 6, force_n);
    ShellState moved = expected;
    ASSERT_TRUE(newton.Solve(loads, push + small, moved).ok());
    Eigen::VectorXd motion = Eigen::VectorXd::Zero(small.size());
    const auto off = [&] {
      double longest_off = 0, longest = 0;
      for (int node = 0; node < skin.shell().node_count(); ++node) {
        const int dof = skin.shell().Dof(node, 0);
        if (dof < 0) continue;
        const auto i = static_cast<size_t>(node);
        const Vec3 by = moved.mids_mm[i] - expected.mids_mm[i];
        longest = std::max(longest, by.norm());
        longest_off = std::max(longest_off, (motion.segment<3>(dof) - by).norm());
      }
      return longest_off / longest;
    };
    ASSERT_TRUE(solver.Response(inflated->stiffness, loads, state, small, 0.05, motion));
    EXPECT_LT(off(), 0.05) << name;
    motion *= 1.03;  // an estimate, which is corrected
    ASSERT_TRUE(solver.Response(inflated->stiffness, loads, state, small, 0.05, motion));
    EXPECT_LT(off(), 0.01) << name;
    EXPECT_GT(solver.Stability(inflated->stiffness, loads, state), 0);
  }
}

TEST(RingEquilibriumTest, SaysWhereThereIsNone) {
  const SkinUnderPressure skin("cylinder");
  const auto slack = Inflate(skin.shell(), 0);
  ASSERT_TRUE(slack.has_value());
  RingEquilibrium solver(skin.shell());
  ShellState state = slack->state;
  EXPECT_FALSE(solver.Solve(slack->stiffness, {}, skin.Push(9, 5, 100), state).converged);
  state = slack->state;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(solver.Solve(slack->stiffness, {}, skin.Push(9, 5, nan), state).converged);
}

// A slack skin that the equations balance under suction, but which would buckle.
TEST(RingEquilibriumTest, SaysWhatIsNotStable) {
  const SkinUnderPressure skin("cylinder");
  const auto slack = Inflate(skin.shell(), 0);
  ASSERT_TRUE(slack.has_value());
  const FollowerPressure suction(-1.3e-4);
  const ElementLoad* loads[] = {&suction};
  RingEquilibrium solver(skin.shell());
  ShellState state = slack->state;
  ASSERT_TRUE(solver.Solve(slack->stiffness, loads, {}, state).converged);
  EXPECT_LE(solver.Stability(slack->stiffness, loads, state), 0);
}

// Beyond what the slack skin stands at once: in steps.
TEST(InflatedSkinTest, StandsHighPressure) {
  const SkinUnderPressure skin("cylinder");
  const auto inflated = Inflate(skin.shell(), 1.5e-2);
  ASSERT_TRUE(inflated.has_value());
  const Vec3& mid = inflated->state.mids_mm[static_cast<size_t>(skin.shell().node_count() / 2)];
  EXPECT_GT(mid.head<2>().norm(), 50);
}

}  // namespace
}  // namespace taclink
