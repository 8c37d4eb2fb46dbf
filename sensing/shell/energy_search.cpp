#include "sensing/shell/energy_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "sensing/shell/node_steps.h"

namespace taclink {
namespace {

constexpr size_t kMostPairs = 8;
constexpr int kMostHalvings = 12;
constexpr double kLeastCurvature = 1e-10;  // of a pair, by the product of its lengths
constexpr double kArmijo = 1e-4;           // share of the decrease that the slope promises

}  // namespace

EnergySearch::EnergySearch(const NonlinearShell& shell, const EnergySearchOptions& options)
    : shell_(shell),
      options_(options),
      noise_nmm_(0.01 * shell.material().youngs_modulus_mpa * std::pow(shell.surface().thickness_mm, 3)) {}

bool EnergySearch::IsTooFarIn(const ShellState& state) const {
  if (options_.least_radius_mm < 0) return false;
  const double least2 = options_.least_radius_mm * options_.least_radius_mm;
  return std::ranges::any_of(state.mids_mm,
                             [least2](const Vec3& mid) { return mid.head<2>().squaredNorm() < least2; });
}

void EnergySearch::Remember(const Eigen::VectorXd& step, const Eigen::VectorXd& change) {
  const double product = step.dot(change);
  if (!(product > kLeastCurvature * step.norm() * change.norm())) return;
  if (pairs_.size() == kMostPairs) pairs_.pop_front();
  pairs_.push_back({step, change, 1 / product});
}

// The two loops of [nocedal2006, algorithm 7.4].
void EnergySearch::Respond(const Response& initial, const Eigen::VectorXd& forces,
                           Eigen::VectorXd& motion) const {
  std::array<double, kMostPairs> shares{};
  Eigen::VectorXd left = forces;
  for (size_t i = pairs_.size(); i-- > 0;) {
    shares[i] = pairs_[i].scale * pairs_[i].step.dot(left);
    left -= shares[i] * pairs_[i].change;
  }
  initial(left, motion);
  for (size_t i = 0; i < pairs_.size(); ++i)
    motion += (shares[i] - pairs_[i].scale * pairs_[i].change.dot(motion)) * pairs_[i].step;
}

EnergySearch::Summary EnergySearch::Minimize(const Energy& energy, const Response& initial,
                                             ShellState& state) {
  pairs_.clear();
  Summary summary;
  double energy_nmm = energy(state, gradient_);
  ++summary.evaluations;
  if (!std::isfinite(energy_nmm) || !gradient_.allFinite()) return summary;
  for (;;) {
    Respond(initial, -gradient_, step_);
    if (!step_.allFinite()) return summary;
    const double share_in_bounds = ShareWithin(step_, options_.longest_step_mm, options_.most_turn_rad);
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
      trial_nmm = energy(trial_, next_gradient_);
      ++summary.evaluations;
      // Below what the energy resolves, a step is taken on trust.
      const double noise = 1e-11 * std::max(noise_nmm_, std::abs(energy_nmm));
      if (next_gradient_.allFinite() && trial_nmm <= energy_nmm + kArmijo * share * slope + noise) break;
    }
    Remember(share * step_, next_gradient_ - gradient_);
    std::swap(state, trial_);
    std::swap(gradient_, next_gradient_);
    energy_nmm = trial_nmm;
    if (IsTooFarIn(state)) return summary;
  }
}

}  // namespace taclink
