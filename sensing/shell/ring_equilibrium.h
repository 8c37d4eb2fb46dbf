#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "sensing/shell/energy_search.h"
#include "sensing/shell/nonlinear_shell.h"
#include "sensing/shell/ring_stiffness.h"

namespace taclink {

/// Finds a skin's equilibrium by minimizing its energy (EnergySearch) from the factor of the inflated skin's
/// stiffness. Skins that stand clear of their tube take up to 60 evaluations; those that buckle onto it, 400.
/// Not thread-safe.
class RingEquilibrium {
 public:
  explicit RingEquilibrium(const NonlinearShell& shell, const EnergySearchOptions& options = {});

  using Summary = EnergySearch::Summary;
  /// From `state` to an equilibrium. `dead_load`: by degree of freedom, forces alone (N); empty: none.
  Summary Solve(const RingStiffness& near, NonlinearShell::Loads loads, const Eigen::VectorXd& dead_load,
                ShellState& state);

  /// Of the equilibrium at `state`, where the last Solve ended: the smallest Ritz value of the stiffness
  /// relative to the approximate one that Solve has come to, after at most 24 iterations of Lanczos' method
  /// from a random force. Near 1: it is about as stiff; near 0: it is about to buckle; not above 0: unstable.
  /// The smallest eigenvalue is not above it. `loads`: without dead ones.
  double Stability(const RingStiffness& near, NonlinearShell::Loads loads, const ShellState& state);
  /// The first-order motion by forces (columns) about the same state. `motions`: in, an estimate by column,
  /// zero where there is none. `tolerance`: the last correction by the motion; with a `Stability` s, the
  /// error is about 1 / s times as large. False: the stiffness is not positive definite, or conjugate
  /// gradients do not converge.
  bool Response(const RingStiffness& near, NonlinearShell::Loads loads, const ShellState& state,
                const Eigen::Ref<const Eigen::MatrixXd>& forces, double tolerance,
                Eigen::Ref<Eigen::MatrixXd> motions);

 private:
  double Evaluate(NonlinearShell::Loads loads, const Eigen::VectorXd& dead_load, const ShellState& state,
                  Eigen::VectorXd& gradient) const;
  enum class Outcome : uint8_t { kConverged, kIndefinite, kUnsettled };
  /// One iteration of conjugate gradients: the length of its step, and the ratio of its residual's norm to
  /// that of the iteration before, both in the preconditioner's norm and squared.
  struct Coefficients {
    double length = 0, ratio = 0;
  };
  Outcome FindResponse(const RingStiffness& near, NonlinearShell::Loads loads, const ShellState& state,
                       const Eigen::VectorXd& forces, double tolerance, int most_iterations,
                       Eigen::VectorXd& motion, std::vector<Coefficients>* coefficients = nullptr);

  const NonlinearShell& shell_;
  EnergySearch search_;
  ShellState trial_;
  Eigen::VectorXd gradient_, next_gradient_;
};

}  // namespace taclink
