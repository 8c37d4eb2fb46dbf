#pragma once

#include <Eigen/Core>
#include <deque>
#include <functional>

#include "sensing/shell/nonlinear_shell.h"

namespace taclink {

struct EnergySearchOptions {
  double tolerance_mm = 1e-4;  ///< longest motion of a node in the last step
  int most_evaluations = 150;  ///< of the gradient
  double longest_step_mm = 8;
  double most_turn_rad = 0.5;   ///< of a node in a step
  double least_radius_mm = -1;  ///< the search ends where a node comes closer to the axis
};

/// Minimizes an energy of a shell's state with L-BFGS [nocedal2006, section 7.2] and a line search. The
/// initial inverse Hessian is a constant one, such as the factor of a similar skin's stiffness, so that an
/// iteration costs a gradient and a back substitution instead of a Hessian and its factor. One thread.
class EnergySearch {
 public:
  explicit EnergySearch(const NonlinearShell& shell, const EnergySearchOptions& options = {});

  /// N mm; sets the gradient by the shell's degrees of freedom.
  using Energy = std::function<double(const ShellState& state, Eigen::VectorXd& gradient)>;
  /// motion := about Hessian^-1 forces.
  using Response = std::function<void(const Eigen::VectorXd& forces, Eigen::VectorXd& motion)>;
  struct Summary {
    bool converged = false;
    int evaluations = 0;
  };
  /// From `state` to a minimum, or to where the search ended.
  Summary Minimize(const Energy& energy, const Response& initial, ShellState& state);
  /// The approximate inverse Hessian that the last Minimize came to. `initial`: the same.
  void Respond(const Response& initial, const Eigen::VectorXd& forces, Eigen::VectorXd& motion) const;

 private:
  struct Pair {
    Eigen::VectorXd step, change;  // of the state and of the gradient
    double scale = 0;              // one over their product
  };
  bool IsTooFarIn(const ShellState& state) const;
  void Remember(const Eigen::VectorXd& step, const Eigen::VectorXd& change);

  const NonlinearShell& shell_;
  const EnergySearchOptions options_;
  const double noise_nmm_;  // the least energy whose rounding may matter, over 1e-11
  std::deque<Pair> pairs_;  // of the last Minimize, the oldest first
  ShellState trial_;
  Eigen::VectorXd gradient_, next_gradient_, step_;
};

}  // namespace taclink
