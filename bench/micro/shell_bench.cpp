// What a frame of the nonlinear model is made of: the shell's gradient and Hessian, the factor and its use.
// One core.
#include <benchmark/benchmark.h>

#include <Eigen/SparseCore>

#include "sensing/model/model_file.h"
#include "sensing/shell/nonlinear_shell.h"
#include "sensing/shell/sparse_cholesky.h"

namespace taclink {
namespace {

struct ShellBench {
  explicit ShellBench(int refinement)
      : model(LoadLinkModel("cylinder").value()),
        shell(SkinSurface(MakeShellMesh(model, refinement)), model.material),
        state(shell.Rest()),
        pressure(1e-3),
        hessian(shell.Pattern()),
        factor(hessian) {}

  LinkModel model;
  NonlinearShell shell;
  ShellState state;
  FollowerPressure pressure;
  const ElementLoad* loads[1] = {&pressure};
  Eigen::VectorXd gradient, solution;
  Eigen::SparseMatrix<double> hessian;
  SparseCholesky factor;
};

void Gradient(benchmark::State& state) {
  ShellBench b(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(b.shell.Gradient(b.state, b.loads, b.gradient));
}

void Hessian(benchmark::State& state) {
  ShellBench b(static_cast<int>(state.range(0)));
  for (auto _ : state) benchmark::DoNotOptimize(b.shell.Hessian(b.state, b.loads, b.gradient, b.hessian));
}

void Factorise(benchmark::State& state) {
  ShellBench b(static_cast<int>(state.range(0)));
  b.shell.Hessian(b.state, b.loads, b.gradient, b.hessian);
  for (auto _ : state) benchmark::DoNotOptimize(b.factor.Factorise(b.hessian));
}

void SolveOne(benchmark::State& state) {
  ShellBench b(static_cast<int>(state.range(0)));
  b.shell.Hessian(b.state, b.loads, b.gradient, b.hessian);
  b.factor.Factorise(b.hessian);
  for (auto _ : state) b.factor.Solve(b.gradient, b.solution);
}

BENCHMARK(Gradient)->Arg(1)->Arg(2)->ArgName("refinement")->Unit(benchmark::kMicrosecond);
BENCHMARK(Hessian)->Arg(1)->Arg(2)->ArgName("refinement")->Unit(benchmark::kMicrosecond);
BENCHMARK(Factorise)->Arg(1)->Arg(2)->ArgName("refinement")->Unit(benchmark::kMicrosecond);
BENCHMARK(SolveOne)->Arg(1)->Arg(2)->ArgName("refinement")->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace taclink
