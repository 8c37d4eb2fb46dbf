#include "sensing/shell/ring_equilibrium.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "sensing/shell/node_steps.h"

namespace taclink {
namespace {

constexpr double kDifferenceShare = 3e-4;  // of the thickness: a node's motion, for differences of gradients
constexpr int kStabilityIterations = 24, kMostResponseIterations = 60;
constexpr double kStabilityTolerance = 1e-3;

EnergySearch::Response ResponseOf(const RingStiffness& near) {
  return [&near](const Eigen::VectorXd& forces, Eigen::VectorXd& motion) { near.Solve(forces, motion); };
}

}  // namespace

RingEquilibrium::RingEquilibrium(const NonlinearShell& shell, const EnergySearchOptions& options)
    : shell_(shell), search_(shell, options) {}

double RingEquilibrium::Evaluate(NonlinearShell::Loads loads, const Eigen::VectorXd& dead_load,
                                 const ShellState& state, Eigen::VectorXd& gradient) const {
  double energy_nmm = shell_.Gradient(state, loads, gradient);
  if (dead_load.size() == 0) return energy_nmm;
  gradient -= dead_load;
  const std::vector<Vec3>& rest_mm = shell_.surface().mids_mm;
  for (size_t node = 0; node < rest_mm.size(); ++node) {
    const int dof = shell_.Dof(static_cast<int>(node), 0);
    if (dof >= 0) energy_nmm -= dead_load.segment<3>(dof).dot(state.mids_mm[node] - rest_mm[node]);
  }
  return energy_nmm;
}

RingEquilibrium::Summary RingEquilibrium::Solve(const RingStiffness& near, NonlinearShell::Loads loads,
                                                const Eigen::VectorXd& dead_load, ShellState& state) {
  const auto energy = [&](const ShellState& at, Eigen::VectorXd& gradient) {
    return Evaluate(loads, dead_load, at, gradient);
  };
  return search_.Minimize(energy, ResponseOf(near), state);
}

// Conjugate gradients [golub2013], preconditioned by what Solve came to; products with the stiffness are
// differences to `gradient_`, which is that at `state`. Converged: the next step is a share `tolerance` of
// the motion.
RingEquilibrium::Outcome RingEquilibrium::FindResponse(const RingStiffness& near, NonlinearShell::Loads loads,
                                                       const ShellState& state, const Eigen::VectorXd& forces,
                                                       double tolerance, int most_iterations,
                                                       Eigen::VectorXd& motion,
                                                       std::vector<Coefficients>* coefficients) {
  const double thickness_mm = shell_.surface().thickness_mm;
  const auto times_stiffness = [&](const Eigen::VectorXd& direction, Eigen::VectorXd& product) {
    const double share = kDifferenceShare * thickness_mm / LongestMotion(direction, thickness_mm);
    trial_ = state;
    shell_.Step(share * direction, trial_);
    shell_.Gradient(trial_, loads, next_gradient_);
    product = (next_gradient_ - gradient_) / share;
  };
  const EnergySearch::Response initial = ResponseOf(near);
  Eigen::VectorXd left = forces, direction = Eigen::VectorXd::Zero(forces.size()), next_step, stiff;
  if (!motion.isZero(0)) {
    times_stiffness(motion, stiff);
    left -= stiff;
  }
  double last_product = 1;
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    search_.Respond(initial, left, next_step);
    if (LongestMotion(next_step, thickness_mm) <= tolerance * LongestMotion(motion, thickness_mm)) {
      motion += next_step;  // whose step length is about 1
      return motion.allFinite() ? Outcome::kConverged : Outcome::kUnsettled;
    }
    const double product = left.dot(next_step);
    const double ratio = iteration > 0 ? product / last_product : 0;
    direction = next_step + ratio * direction;
    last_product = product;
    times_stiffness(direction, stiff);
    const double length = product / direction.dot(stiff);
    if (coefficients != nullptr) coefficients->push_back({length, ratio});
    if (!(length > 0) || !std::isfinite(length)) return Outcome::kIndefinite;
    motion += length * direction;
    left -= length * stiff;
  }
  return Outcome::kUnsettled;
}

bool RingEquilibrium::Response(const RingStiffness& near, NonlinearShell::Loads loads,
                               const ShellState& state, const Eigen::Ref<const Eigen::MatrixXd>& forces,
                               double tolerance, Eigen::Ref<Eigen::MatrixXd> motions) {
  shell_.Gradient(state, loads, gradient_);
  Eigen::VectorXd motion;
  for (Eigen::Index k = 0; k < forces.cols(); ++k) {
    motion = motions.col(k);
    if (FindResponse(near, loads, state, forces.col(k), tolerance, kMostResponseIterations, motion) !=
        Outcome::kConverged)
      return false;
    motions.col(k) = motion;
  }
  return true;
}

// The coefficients of conjugate gradients make up the tridiagonal matrix of Lanczos' method [golub2013,
// section 11.3], whose eigenvalues are the Ritz values. Started from a random force, which excites all modes.
double RingEquilibrium::Stability(const RingStiffness& near, NonlinearShell::Loads loads,
                                  const ShellState& state) {
  std::minstd_rand random(1);
  std::uniform_real_distribution<double> number(-1, 1);
  Eigen::VectorXd forces(shell_.dof_count()), motion = Eigen::VectorXd::Zero(shell_.dof_count());
  for (double& force : forces) force = number(random);
  shell_.Gradient(state, loads, gradient_);
  std::vector<Coefficients> all;
  if (FindResponse(near, loads, state, forces, kStabilityTolerance, kStabilityIterations, motion, &all) ==
      Outcome::kIndefinite)
    return 0;
  const auto count = static_cast<Eigen::Index>(all.size());
  Eigen::VectorXd diagonal(count), beside(std::max<Eigen::Index>(count - 1, 0));
  for (Eigen::Index i = 0; i < count; ++i) {
    const Coefficients& at = all[static_cast<size_t>(i)];
    diagonal[i] = 1 / at.length;
    if (i == 0) continue;
    const double before = all[static_cast<size_t>(i) - 1].length;
    diagonal[i] += at.ratio / before;
    beside[i - 1] = std::sqrt(at.ratio) / before;
  }
  if (count == 0) return 1;
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> ritz;
  ritz.computeFromTridiagonal(diagonal, beside, Eigen::EigenvaluesOnly);
  return ritz.eigenvalues().minCoeff();
}

}  // namespace taclink
