#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>

#include "sensing/shell/nonlinear_shell.h"
#include "sensing/shell/ring_stiffness.h"

namespace taclink {

struct RingEquilibriumOptions {
  double tolerance_mm = 1e-4;   ///< longest motion of a node in the last step
  int most_evaluations = 60;    ///< of the gradient
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

  /// The first-order motion by forces (columns) about `state`, where the last Solve ended. `loads`: without
  /// dead ones. `motions`: in, an estimate by column, zero where there is none; out, of which the last
  /// correction was at most 5 percent. False: the stiffness there is not positive definite, or conjugate
  /// gradients do not converge.
  bool Response(const RingStiffness& near, NonlinearShell::Loads loads, const ShellState& state,
                const Eigen::Ref<const Eigen::MatrixXd>& forces, Eigen::Ref<Eigen::MatrixXd> motions);
  /// Whether the equilibrium at `state` is stable, as far as sixteen conjugate gradients see. `loads`: as
  /// for Response.
  bool IsStable(const RingStiffness& near, NonlinearShell::Loads loads, const ShellState& state);

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
  Outcome FindResponse(const RingStiffness& near, NonlinearShell::Loads loads, const ShellState& state,
                       const Eigen::VectorXd& forces, double least, int most_iterations,
                       Eigen::VectorXd& motion);
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
