#include "sensing/shell/sparse_cholesky.h"

#include <gtest/gtest.h>

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <thread>
#include <vector>

#include "sensing/model/model_file.h"
#include "sensing/shell/nonlinear_shell.h"
#include "sensing/shell/shell_mesh.h"

namespace taclink {
namespace {

Eigen::SparseMatrix<double> SkinStiffness(int refinement) {
  const LinkModel model = LoadLinkModel("cylinder").value();
  const ShellMesh mesh = MakeShellMesh(model, refinement);
  const NonlinearShell shell(SkinSurface(mesh), model.material);
  Eigen::SparseMatrix<double> hessian = shell.Pattern();
  Eigen::VectorXd gradient;
  shell.Hessian(shell.Rest(), {}, gradient, hessian);
  return hessian;
}

TEST(SparseCholesky, SolvesAsAnotherFactorisationDoes) {
  const auto stiffness = SkinStiffness(1);
  SparseCholesky factor(stiffness);
  ASSERT_TRUE(factor.Factorise(stiffness));
  const Eigen::MatrixXd loads = Eigen::MatrixXd::Random(stiffness.rows(), 7);
  Eigen::MatrixXd motions;
  factor.Solve(loads, motions);
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> other(stiffness);
  const Eigen::MatrixXd expected = other.solve(loads);
  EXPECT_LT((motions - expected).norm() / expected.norm(), 1e-9);
  EXPECT_LT((factor.Solve(Eigen::VectorXd(loads.col(3))) - motions.col(3)).norm() / motions.col(3).norm(),
            1e-12);
}

TEST(SparseCholesky, SaysWhatIsNotPositiveDefiniteAndGoesOn) {
  const auto stiffness = SkinStiffness(1);
  SparseCholesky factor(stiffness);
  auto indefinite = stiffness;
  indefinite.coeffRef(40, 40) = -1;
  EXPECT_FALSE(factor.Factorise(indefinite));
  EXPECT_TRUE(factor.Factorise(stiffness));
}

// Links solve at the same time; a BLAS that shares memory between its callers would make them wrong.
TEST(SparseCholesky, ThreadsDoNotDisturbEachOther) {
  const auto stiffness = SkinStiffness(2);
  const Eigen::MatrixXd loads = Eigen::MatrixXd::Ones(stiffness.rows(), 16);
  Eigen::MatrixXd alone;
  {
    SparseCholesky factor(stiffness);
    ASSERT_TRUE(factor.Factorise(stiffness));
    factor.Solve(loads, alone);
  }
  constexpr int kThreads = 4, kRounds = 15;
  std::vector<double> worst(kThreads, 0.0);
  std::vector<std::thread> threads;
  for (size_t t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      SparseCholesky factor(stiffness);
      Eigen::MatrixXd motions;
      for (int round = 0; round < kRounds; ++round) {
        if (!factor.Factorise(stiffness)) {
          worst[t] = 1;
          return;
        }
        factor.Solve(loads, motions);
        worst[t] = std::max(worst[t], (motions - alone).norm() / alone.norm());
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const double error : worst) EXPECT_LT(error, 1e-9);
}

}  // namespace
}  // namespace taclink
