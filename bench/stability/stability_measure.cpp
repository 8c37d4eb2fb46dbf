#include "bench/stability/stability_measure.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "sensing/shell/equilibrium.h"

namespace taclink {
namespace {

using Sparse = Eigen::SparseMatrix<double>;
constexpr int kPowerIterations = 60;

double UnitOf(const NonlinearShell& shell) {
  return shell.material().youngs_modulus_mpa * shell.surface().thickness_mm * shell.surface().thickness_mm;
}

// Length that belongs to one unit of each degree of freedom.
Eigen::VectorXd Lengths(const NonlinearShell& shell) {
  Eigen::VectorXd lengths(shell.dof_count());
  for (int node = 0; node < shell.node_count(); ++node) {
    for (int c = 0; c < 5; ++c) {
      if (const int dof = shell.Dof(node, c); dof >= 0)
        lengths[dof] = c < 3 ? 1 : shell.surface().thickness_mm;
    }
  }
  return lengths;
}

Eigen::VectorXd Noise(Eigen::Index size) {
  std::mt19937_64 bits(7);
  std::normal_distribution<double> normal;
  Eigen::VectorXd v(size);
  for (Eigen::Index i = 0; i < size; ++i) v[i] = normal(bits);
  return v;
}

double Largest(const Eigen::VectorXd& v) {
  return v.cwiseAbs().maxCoeff();
}

// Eigenvalue of largest size of a symmetric operator.
template <typename Apply>
double PowerIteration(Eigen::Index size, Apply apply) {
  Eigen::VectorXd v = Noise(size).normalized();
  double value = 0;
  for (int i = 0; i < kPowerIterations; ++i) {
    const Eigen::VectorXd w = apply(v);
    value = w.norm();
    v = w / value;
  }
  return value;
}

}  // namespace

TangentNumbers MeasureTangent(const NonlinearShell& shell, NonlinearShell::Loads loads,
                              const ShellState& state) {
  TangentNumbers numbers;
  Sparse lower = shell.Pattern();
  Eigen::VectorXd gradient;
  shell.Hessian(state, loads, gradient, lower);
  const Eigen::VectorXd per_length = Lengths(shell).cwiseInverse();
  lower = per_length.asDiagonal() * lower * per_length.asDiagonal();
  const Eigen::SimplicialLLT<Sparse, Eigen::Lower> factor(lower);
  numbers.definite = factor.info() == Eigen::Success;
  if (!numbers.definite) return numbers;
  const Sparse full = lower.selfadjointView<Eigen::Lower>();
  const double largest = PowerIteration(full.rows(), [&](const Eigen::VectorXd& v) { return full * v; });
  const double inverse =
      PowerIteration(full.rows(), [&](const Eigen::VectorXd& v) { return factor.solve(v); });
  numbers.condition = largest * inverse;
  const Eigen::VectorXd b = Noise(full.rows());
  const Eigen::VectorXd x = factor.solve(b);
  const double norm = (full.cwiseAbs() * Eigen::VectorXd::Ones(full.cols())).maxCoeff();
  numbers.backward_error = Largest(full * x - b) / (norm * Largest(x) + Largest(b));
  const Eigen::SparseMatrix<float> lower_float = lower.cast<float>();
  const Eigen::SimplicialLLT<Eigen::SparseMatrix<float>, Eigen::Lower> single(lower_float);
  numbers.float_error = std::numeric_limits<double>::infinity();
  if (single.info() == Eigen::Success) {
    const Eigen::VectorXf y = single.solve(b.cast<float>());
    numbers.float_error = (y.cast<double>() - x).norm() / x.norm();
  }
  return numbers;
}

double Reciprocity(const NonlinearShell& shell, NonlinearShell::Loads loads, const ShellState& state,
                   int dof_a, int dof_b) {
  constexpr double kForce = 1e-4, kTolerance = 1e-11;  // of E t^2
  EquilibriumSolver solver(shell, {.tolerance_n = kTolerance * UnitOf(shell)});
  const auto place = [&](const ShellState& s, int dof) {
    for (int node = 0; node < shell.node_count(); ++node) {
      for (int c = 0; c < 3; ++c) {
        if (shell.Dof(node, c) == dof) return s.mids_mm[static_cast<size_t>(node)][c];
      }
    }
    return 0.0;
  };
  bool solved = true;
  // Displacement of `seen` by a force on `pushed`.
  const auto answer = [&](int pushed, int seen) {
    double difference = 0;
    for (const double sign : {1.0, -1.0}) {
      Eigen::VectorXd load = Eigen::VectorXd::Zero(shell.dof_count());
      load[pushed] = sign * kForce * UnitOf(shell);
      ShellState s = state;
      // At the limit of rounding no step lowers the energy any more; that is as good as it gets.
      const EquilibriumSummary summary = solver.Solve(loads, load, s);
      solved = solved && (summary.ok() || summary.residual_n < 1e3 * kTolerance * UnitOf(shell));
      difference += sign * place(s, seen);
    }
    return difference / 2;
  };
  const double ab = answer(dof_a, dof_b), ba = answer(dof_b, dof_a);
  if (!solved) return std::numeric_limits<double>::quiet_NaN();
  return std::abs(ab - ba) / std::max(std::abs(ab), std::abs(ba));
}

double ResidualOf(const NonlinearShell& shell, NonlinearShell::Loads loads, const ShellState& state) {
  Eigen::VectorXd gradient;
  shell.Gradient(state, loads, gradient);
  return Largest(gradient) / UnitOf(shell);
}

double Simpson(const std::vector<double>& y, double step) {
  double sum = y.front() + y.back();
  for (size_t i = 1; i + 1 < y.size(); ++i) sum += (i % 2 == 1 ? 4 : 2) * y[i];
  return sum * step / 3;
}

}  // namespace taclink
