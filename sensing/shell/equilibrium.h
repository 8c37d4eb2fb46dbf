#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>

#include "sensing/shell/nonlinear_shell.h"

namespace taclink {

enum class EquilibriumStop {
  kConverged,      ///< the residual is below the tolerance
  kMaxIterations,  ///< still moving
  kNoDescent,      ///< no step lowers the energy: at the limit of rounding
  kNotFinite,      ///< the state or the energy is not a number
  kSingular,       ///< no matrix to solve with was found
};
const char* Name(EquilibriumStop stop);

struct EquilibriumOptions {
  double tolerance_n = 1e-6;  ///< largest entry of the residual, N or N mm
  int max_iterations = 60;
  double max_step_mm = 4;  ///< longest motion of a node in one iteration; rotations: half a radian
};

struct EquilibriumSummary {
  EquilibriumStop stop = EquilibriumStop::kConverged;
  int iterations = 0;
  int shifted = 0;        ///< iterations whose Hessian was made positive definite
  double residual_n = 0;  ///< largest entry
  double energy_nmm = 0;
  bool stable = true;  ///< the last Hessian was positive definite: a minimum of the energy
  bool ok() const { return stop == EquilibriumStop::kConverged; }
};

/// Finds a shell's equilibrium as a minimum of its energy: Newton's method with line search
/// [nocedal2006, section 3.1]; a Hessian that is not positive definite is shifted until it is
/// [nocedal2006, section 3.4]. Keeps the matrix's structure from one solve to the next. One thread.
class EquilibriumSolver {
 public:
  explicit EquilibriumSolver(const NonlinearShell& shell, const EquilibriumOptions& options = {});
  ~EquilibriumSolver();

  /// From `state` to an equilibrium. `dead_load`: by degree of freedom, N or N mm; empty: none. A moment on a
  /// rotation has no potential: use `line_search` false with it, and load steps. It is then plain Newton,
  /// which may end in a saddle of the energy.
  EquilibriumSummary Solve(NonlinearShell::Loads loads, const Eigen::VectorXd& dead_load, ShellState& state,
                           bool line_search = true);

 private:
  struct Factor;
  bool FindStep(bool line_search, EquilibriumSummary& summary);
  double LimitOf(const Eigen::VectorXd& step) const;

  const NonlinearShell& shell_;
  EquilibriumOptions options_;
  Eigen::SparseMatrix<double> hessian_;
  Eigen::VectorXd rest_diagonal_, gradient_, step_;
  std::unique_ptr<Factor> factor_;
  double shift_ = 0;  // of the iteration before, as a share of the diagonal
};

}  // namespace taclink
