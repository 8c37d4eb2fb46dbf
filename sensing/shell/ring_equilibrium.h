#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <vector>

#include "sensing/shell/nonlinear_shell.h"
#include "sensing/shell/ring_stiffness.h"

namespace taclink {

struct RingEquilibriumOptions {
  double tolerance_mm = 1e-4;  ///< longest motion of a node in the last step
  /// Of the gradient. Skins that stand clear of their tube take up to 60; those that buckle onto it, 400.
  int most_evaluations = 150;
  double longest_step_mm = 8;   ///< rotations: half a radian
  double least_radius_mm = -1;  ///< the search ends where a node comes closer to the axis
};

/// Finds a skin's equilibrium by minimizing its energy with L-BFGS [nocedal2006, section 7.2] and a line
/// search. The initial inverse Hessian is the factor of the inflated skin's stiffness, so an iteration costs
/// a gradient and a back substitution instead of a Hessian and its factorization. Not thread-safe.
class RingEquilibrium {
 public:
  explicit RingEquilibrium(const NonlinearShell& shell, const RingEquilibriumOptions& options = {});

  struct Summary {
    bool converged = false;
    int evaluations = 0;
  };
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
  struct Pair {
    Eigen::VectorXd step, change;  // of the state and of the gradient
    double scale = 0;              // one over their product
  };
  double Evaluate(NonlinearShell::Loads loads, const Eigen::VectorXd& dead_load, const ShellState& state,
                  Eigen::VectorXd& gradient) const;
  /// The approximate inverse stiffness that the last Solve has come to.
  void Respond(const RingStiffness& near, const Eigen::VectorXd& forces, Eigen::VectorXd& motion) const;
  enum class Outcome : uint8_t { kConverged, kIndefinite, kUnsettled };
  /// One iteration of conjugate gradients: the length of its step, and the ratio of its residual's norm to
  /// that of the iteration before, both in the preconditioner's norm and squared.
  struct Coefficients {
    double length = 0, ratio = 0;
  };
  Outcome FindResponse(const RingStiffness& near, NonlinearShell::Loads loads, const ShellState& state,
                       const Eigen::VectorXd& forces, double tolerance, int most_iterations,
                       Eigen::VectorXd& motion, std::vector<Coefficients>* coefficients = nullptr);
  bool IsTooFarIn(const ShellState& state) const;
  void Remember(const Eigen::VectorXd& step, const Eigen::VectorXd& change);

  const NonlinearShell& shell_;
  const RingEquilibriumOptions options_;
  const double noise_nmm_;  // the least energy whose rounding may matter, over 1e-11
  std::deque<Pair> pairs_;  // of the last Solve, the oldest first
  ShellState trial_;
  Eigen::VectorXd gradient_, next_gradient_, step_;
};

}  // namespace taclink
