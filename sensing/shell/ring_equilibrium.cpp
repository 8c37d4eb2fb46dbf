#include "sensing/shell/ring_equilibrium.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <utility>

#include "sensing/shell/node_steps.h"

namespace taclink {
namespace {

constexpr size_t kMostPairs = 8;
constexpr int kMostHalvings = 12;
constexpr double kMostTurn = 0.5;
constexpr double kDifferenceShare = 3e-4;  // of the thickness: a node's motion, for differences of gradients
constexpr int kStabilityIterations = 24, kMostResponseIterations = 60;
constexpr double kStabilityTolerance = 1e-3;
constexpr double kLeastCurvature = 1e-10;  // of a pair, by the product of its lengths

}  // namespace

RingEquilibrium::RingEquilibrium(const NonlinearShell& shell, const RingEquilibriumOptions& options)
    : shell_(shell),
      options_(options),
      noise_nmm_(0.01 * shell.material().youngs_modulus_mpa * std::pow(shell.surface().thickness_mm, 3)) {}

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

bool RingEquilibrium::IsTooFarIn(const ShellState& state) const {
  if (options_.least_radius_mm < 0) return false;
  const double least2 = options_.least_radius_mm * options_.least_radius_mm;
  return std::ranges::any_of(state.mids_mm,
                             [least2](const Vec3& mid) { return mid.head<2>().squaredNorm() < least2; });
}

void RingEquilibrium::Remember(const Eigen::VectorXd& step, const Eigen::VectorXd& change) {
  const double product = step.dot(change);
  if (!(product > kLeastCurvature * step.norm() * change.norm())) return;
  if (pairs_.size() == kMostPairs) pairs_.pop_front();
  pairs_.push_back({step, change, 1 / product});
}

// The two loops of [nocedal2006, algorithm 7.4].
void RingEquilibrium::Respond(const RingStiffness& near, const Eigen::VectorXd& forces,
                              Eigen::VectorXd& motion) const {
  std::array<double, kMostPairs> shares{};
  Eigen::VectorXd left = forces;
  for (size_t i = pairs_.size(); i-- > 0;) {
    shares[i] = pairs_[i].scale * pairs_[i].step.dot(left);
    left -= shares[i] * pairs_[i].change;
  }
  near.Solve(left, motion);
  for (size_t i = 0; i < pairs_.size(); ++i)
    motion += (shares[i] - pairs_[i].scale * pairs_[i].change.dot(motion)) * pairs_[i].step;
}

RingEquilibrium::Summary RingEquilibrium::Solve(const RingStiffness& near, NonlinearShell::Loads loads,
                                                const Eigen::VectorXd& dead_load, ShellState& state) {
  pairs_.clear();
  Summary summary;
  double energy_nmm = Evaluate(loads, dead_load, state, gradient_);
  ++summary.evaluations;
  if (!std::isfinite(energy_nmm) || !gradient_.allFinite()) return summary;
  for (;;) {
    Respond(near, -gradient_, step_);
    if (!step_.allFinite()) return summary;
    const double share_in_bounds = ShareWithin(step_, options_.longest_step_mm, kMostTurn);
    step_ *= share_in_bounds;
    if (share_in_bounds == 1 && LongestTranslation(step_) < options_.tolerance_mm) {
      shell_.Step(step_, state);
      summary.converged = true;
      return summary;
    }
    const double slope = gradient_.dot(step_);
    double share = 1, trial_nmm = 0;
    for (int halving = 0;; ++halving, share /= 2) {
      if (summary.evaluations >= options_.most_evaluations || halving > kMostHalvings) return summary;
      trial_ = state;
      shell_.Step(share * step_, trial_);
      trial_nmm = Evaluate(loads, dead_load, trial_, next_gradient_);
      ++summary.evaluations;
      // Below what the energy resolves, a step is taken on trust.
      const double noise = 1e-11 * std::max(noise_nmm_, std::abs(energy_nmm));
      if (next_gradient_.allFinite() && trial_nmm <= energy_nmm + 1e-4 * share * slope + noise) break;
    }
    Remember(share * step_, next_gradient_ - gradient_);
    std::swap(state, trial_);
    std::swap(gradient_, next_gradient_);
    energy_nmm = trial_nmm;
    if (IsTooFarIn(state)) return summary;
  }
}

// Conjugate gradients [golub2013], preconditioned by the pairs of Solve; products with the stiffness are
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
  Eigen::VectorXd left = forces, direction = Eigen::VectorXd::Zero(forces.size()), next_step, stiff;
  if (!motion.isZero(0)) {
    times_stiffness(motion, stiff);
    left -= stiff;
  }
  double last_product = 1;
  for (int iteration = 0; iteration < most_iterations; ++iteration) {
    Respond(near, left, next_step);
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
