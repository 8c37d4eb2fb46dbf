#include "sensing/shell/equilibrium.h"

#include <Eigen/CholmodSupport>
#include <algorithm>
#include <cmath>

#include "sensing/shell/sparse_cholesky.h"

namespace taclink {

const char* Name(EquilibriumStop stop) {
  switch (stop) {
    case EquilibriumStop::kConverged:
      return "converged";
    case EquilibriumStop::kMaxIterations:
      return "iteration limit";
    case EquilibriumStop::kNoDescent:
      return "no descent";
    case EquilibriumStop::kNotFinite:
      return "not finite";
    case EquilibriumStop::kSingular:
      return "singular";
  }
  return "unknown";
}

struct EquilibriumSolver::Factor {
  explicit Factor(const Eigen::SparseMatrix<double>& pattern) : llt(pattern) { ldlt.cholmod().print = 0; }

  SparseCholesky llt;
  // Of a Hessian that isn't positive definite, as it stands.
  Eigen::CholmodSimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> ldlt;
};

EquilibriumSolver::EquilibriumSolver(const NonlinearShell& shell, const EquilibriumOptions& options)
    : shell_(shell),
      options_(options),
      hessian_(shell.Pattern()),
      factor_(std::make_unique<Factor>(hessian_)) {
  shell_.Hessian(shell_.Rest(), {}, gradient_, hessian_);
  rest_diagonal_ = hessian_.diagonal();
}

EquilibriumSolver::~EquilibriumSolver() = default;

// Sets step_. Of a Hessian that is not positive definite: adds to its diagonal until it is; without a line
// search there is no energy to go down, and a saddle is as good.
bool EquilibriumSolver::FindStep(bool line_search, EquilibriumSummary& summary) {
  constexpr double kFirst = 1e-4, kMost = 1e2;
  summary.stable = factor_->llt.Factorise(hessian_);
  if (summary.stable) {
    shift_ = 0;
    factor_->llt.Solve(-gradient_, step_);
    return true;
  }
  if (!line_search) {
    factor_->ldlt.compute(hessian_);
    if (factor_->ldlt.info() != Eigen::Success) return false;
    step_ = factor_->ldlt.solve(-gradient_);
    return true;
  }
  ++summary.shifted;
  // Under compression a rotation's own entry may all but vanish next to its neighbours'.
  const Eigen::VectorXd scale = hessian_.diagonal().cwiseAbs().cwiseMax(rest_diagonal_);
  double before = 0;
  for (shift_ = std::max(kFirst, shift_ / 8); shift_ <= kMost; shift_ *= 4) {
    for (Eigen::Index i = 0; i < scale.size(); ++i) hessian_.coeffRef(i, i) += (shift_ - before) * scale[i];
    before = shift_;
    if (!factor_->llt.Factorise(hessian_)) continue;
    factor_->llt.Solve(-gradient_, step_);
    return true;
  }
  return false;
}

// Share of the step that keeps every node's motion in bounds.
double EquilibriumSolver::LimitOf(const Eigen::VectorXd& step) const {
  constexpr double kMaxTurn = 0.5;
  double share = 1;
  for (int node = 0; node < shell_.node_count(); ++node) {
    for (int c = 0; c < 5; ++c) {
      const int dof = shell_.Dof(node, c);
      if (dof < 0) continue;
      const double limit = c < 3 ? options_.max_step_mm : kMaxTurn;
      share = std::min(share, limit / std::max(std::abs(step[dof]), limit));
    }
  }
  return share;
}

EquilibriumSummary EquilibriumSolver::Solve(NonlinearShell::Loads loads, const Eigen::VectorXd& dead_load,
                                            ShellState& state, bool line_search) {
  shift_ = 0;  // what is found depends on no earlier call
  const bool has_dead = dead_load.size() > 0;
  const ShellState rest = shell_.Rest();
  const auto dead_energy = [&](const ShellState& s) {
    if (!has_dead) return 0.0;
    double work = 0;
    for (int node = 0; node < shell_.node_count(); ++node) {
      const auto i = static_cast<size_t>(node);
      for (int c = 0; c < 3; ++c) {
        if (const int dof = shell_.Dof(node, c); dof >= 0) {
          work += dead_load[dof] * (s.mids_mm[i][c] - rest.mids_mm[i][c]);
        }
      }
    }
    return -work;
  };
  EquilibriumSummary summary;
  ShellState trial;
  for (;; ++summary.iterations) {
    summary.energy_nmm = shell_.Hessian(state, loads, gradient_, hessian_) + dead_energy(state);
    if (has_dead) gradient_ -= dead_load;
    summary.residual_n = gradient_.size() > 0 ? gradient_.cwiseAbs().maxCoeff() : 0.0;
    if (!std::isfinite(summary.energy_nmm) || !std::isfinite(summary.residual_n)) {
      summary.stop = EquilibriumStop::kNotFinite;
      return summary;
    }
    const bool small = summary.residual_n <= options_.tolerance_n;
    if (small && summary.iterations > 0) {
      summary.stop = EquilibriumStop::kConverged;
      return summary;
    }
    if (summary.iterations >= options_.max_iterations) {
      summary.stop = EquilibriumStop::kMaxIterations;
      return summary;
    }
    if (!FindStep(line_search, summary)) {
      summary.stop = EquilibriumStop::kSingular;
      return summary;
    }
    double share = LimitOf(step_);
    const double slope = gradient_.dot(step_);
    bool found = !line_search;
    trial = state;
    shell_.Step(share * step_, trial);
    for (int halving = 0; line_search && halving < 30; ++halving) {
      const double energy = shell_.Energy(trial, loads) + dead_energy(trial);
      // Below what the energy resolves, a Newton step is taken on trust.
      const double noise = 1e-12 * std::max(1.0, std::abs(summary.energy_nmm));
      if (energy <= summary.energy_nmm + 1e-4 * share * slope + noise) {
        found = true;
        break;
      }
      share /= 2;
      trial = state;
      shell_.Step(share * step_, trial);
    }
    if (!found) {
      summary.stop = small ? EquilibriumStop::kConverged : EquilibriumStop::kNoDescent;
      return summary;
    }
    std::swap(state, trial);
  }
}

}  // namespace taclink
