// The factor by harmonics against the general sparse factor of the same Hessian.
#include "sensing/shell/ring_stiffness.h"

#include <gtest/gtest.h>

#include <tuple>

#include "sensing/model/model_file.h"
#include "sensing/shell/equilibrium.h"
#include "sensing/shell/shell_mesh.h"
#include "sensing/shell/sparse_cholesky.h"

namespace taclink {
namespace {

constexpr double kSuctionMpa = -2e-3;  // far beyond what the shipped skins stand

// The shipped skin, and the pressure in MPa; `around`: elements, where not the shipped number of paths.
struct Case {
  const char* model;
  double pressure_mpa;
  int around = 0;
};

class RingStiffnessTest : public ::testing::TestWithParam<Case> {
 protected:
  RingStiffnessTest() {
    LinkModel model = LoadLinkModel(GetParam().model).value();
    if (GetParam().around > 0) model.markers.paths = GetParam().around;
    shell_ = std::make_unique<NonlinearShell>(SkinSurface(MakeShellMesh(model, MeshRefinement{1, 1})),
                                              model.material);
    state_ = shell_->Rest();
    EquilibriumSolver solver(*shell_, {.tolerance_n = 1e-9});
    for (int step = 1; step <= 10; ++step) {
      const FollowerPressure pressure(GetParam().pressure_mpa * step / 10);
      const ElementLoad* loads[] = {&pressure};
      EXPECT_TRUE(solver.Solve(loads, {}, state_).ok());
    }
  }
  std::unique_ptr<NonlinearShell> shell_;
  ShellState state_;
};

TEST_P(RingStiffnessTest, SolvesAsTheSparseFactorDoes) {
  const FollowerPressure pressure(GetParam().pressure_mpa);
  const ElementLoad* loads[] = {&pressure};
  ASSERT_TRUE(RingBlocks::Fit(*shell_));
  RingBlocks blocks;
  Eigen::VectorXd gradient, expected_gradient, x, expected;
  const double energy = blocks.Set(*shell_, state_, loads, gradient);
  RingStiffness by_harmonics(*shell_);
  ASSERT_TRUE(by_harmonics.Factorize(blocks));
  Eigen::SparseMatrix<double> hessian = shell_->Pattern();
  const double expected_energy = shell_->Hessian(state_, loads, expected_gradient, hessian);
  EXPECT_NEAR(energy, expected_energy, 1e-9 * std::abs(expected_energy) + 1e-12);
  EXPECT_LT(gradient.cwiseAbs().maxCoeff(), 1e-7);
  SparseCholesky sparse(hessian);
  ASSERT_TRUE(sparse.Factorise(hessian));
  std::srand(7);
  // A load at one node, and one everywhere.
  Eigen::VectorXd rhs = Eigen::VectorXd::Zero(hessian.rows());
  for (int k = 0; k < 2; ++k) {
    if (k == 0)
      rhs.segment<5>(5 * 100) << 1, 0.5, -0.2, 0.7, -1;
    else
      rhs.setRandom();
    sparse.Solve(rhs, expected);
    by_harmonics.Solve(rhs, x);
    EXPECT_LT((x - expected).norm(), 1e-6 * expected.norm()) << k;
  }
}

INSTANTIATE_TEST_SUITE_P(Skins, RingStiffnessTest,
                         ::testing::Values(Case{"cylinder", 0}, Case{"cylinder", 5e-4},
                                           Case{"cylinder", 1.5e-3}, Case{"barrel", 0}, Case{"barrel", 5e-4},
                                           Case{"barrel", 1.5e-3}, Case{"barrel", 1e-3, 25}),
                         [](const auto& tested) {
                           return std::string(tested.param.model) +
                                  std::to_string(static_cast<int>(1e6 * tested.param.pressure_mpa)) + "Pa" +
                                  (tested.param.around > 0 ? std::to_string(tested.param.around) : "");
                         });

TEST(UnstableRingStiffnessTest, IsRefused) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  const NonlinearShell shell(SkinSurface(MakeShellMesh(model, 1)), model.material);
  const FollowerPressure suction(kSuctionMpa);
  const ElementLoad* loads[] = {&suction};
  RingBlocks blocks;
  Eigen::VectorXd gradient;
  blocks.Set(shell, shell.Rest(), loads, gradient);
  EXPECT_FALSE(RingStiffness(shell).Factorize(blocks));
}

TEST(RingBlocksTest, FitNoOtherShells) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  const ShellSurface skin = SkinSurface(MakeShellMesh(model, 1));
  const auto fits = [&](const ShellSurface& surface) {
    return RingBlocks::Fit(NonlinearShell(surface, model.material));
  };
  EXPECT_TRUE(fits(skin));
  ShellSurface seamed = skin;
  seamed.directors[200] = (seamed.directors[200] + Vec3(0, 0, 1e-3)).normalized();
  EXPECT_FALSE(fits(seamed));
  ShellSurface loose = skin;
  loose.fixed.back()[2] = false;
  EXPECT_FALSE(fits(loose));
  ShellSurface turned = skin;
  turned.tangents[100] = turned.directors[100].cross(turned.tangents[100]);
  EXPECT_FALSE(fits(turned));
}

}  // namespace
}  // namespace taclink
