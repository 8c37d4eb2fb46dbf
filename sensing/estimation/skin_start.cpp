// Where a frame begins: the part of SkinEstimator before its steps.
#include <algorithm>
#include <cmath>
#include <limits>

#include "sensing/estimation/isolated_markers.h"
#include "sensing/estimation/skin_estimator.h"

namespace taclink {
namespace {

constexpr double kUntestedMm = 1.2;     // markers that are nearer to a state at hand are not tested first
constexpr double kAssimilateMm = 2.5;   // farther off, a marker is pulled to its place first
constexpr double kMostIsolated = 0.1;   // of the markers; if more are, it is not they that are wrong
constexpr double kNoiseDeviations = 2;  // of a spring's pull, that noise alone makes

}  // namespace

// The farthest that a seen marker is from its place in a state, mm.
double SkinEstimator::FurthestOff(const ShellState& state, const MarkerObservations& observed) {
  mechanics_.markers().Displacements(state, markers_mm_);
  double furthest = 0;
  for (size_t m = 0; m < observed.information.size(); ++m) {
    // One camera tells two directions.
    const Mat3& information = observed.information[m];
    const double most = information.trace();
    if (!(most > 0)) continue;
    const Vec3 off = markers_mm_.segment<3>(3 * static_cast<Eigen::Index>(m)) - observed.displacement_mm[m];
    const double mm = std::sqrt(off.dot(information * off) * 3 / most);
    if (!std::isfinite(mm)) return std::numeric_limits<double>::infinity();
    furthest = std::max(furthest, mm);
  }
  return furthest;
}

// A state near the markers: the untouched skin, the last frame's, or where springs pull either.
bool SkinEstimator::Start(const SkinProblem& problem, SkinEstimate& estimate, Eigen::VectorXd& local_n) {
  const double unit = mechanics_.length_unit();
  estimate.state = problem.untouched.state;
  double off_mm = FurthestOff(estimate.state, problem.observed);
  const auto consider = [&](bool is_there, const ShellState& state) {
    if (!is_there || off_mm < kStillReachMm * unit) return;
    const double mm = FurthestOff(state, problem.observed);
    if (mm >= off_mm) return;
    off_mm = mm;
    estimate.state = state;
  };
  consider(past_.has_last, past_.last);
  consider(past_.has_reached, past_.reached);
  local_n.resize(0);
  if (off_mm > kUntestedMm * unit && gross_errors_.Fails(problem, *still_)) {
    estimate.failure = EstimateFailure::kGrossErrors;
    return false;
  }
  if (off_mm < kAssimilateMm * unit) return true;
  // From the untouched skin, not from the nearer state: where no marker is seen, a dent of the last frame
  // would stay.
  estimate.state = problem.untouched.state;
  Eigen::VectorXd pulls;
  estimate.work.evaluations +=
      assimilation_.Run(problem.observed, problem.untouched, estimate.state, pulls).evaluations;
  const int markers = mechanics_.marker_count();
  Eigen::VectorXd sizes(markers);
  for (int m = 0; m < markers; ++m) {
    const double trace = problem.observed.information[static_cast<size_t>(m)].trace();
    const double noise = trace > 0 ? 3 * kNoiseDeviations / std::sqrt(trace / 3) : 0;
    sizes[m] = std::max(0.0, pulls.segment<3>(3 * m).norm() - noise);
  }
  local_n = touched_->loads.covariance().LocalOfMarkers(sizes);
  start_ = estimate.state;
  // What springs could not settle may still be near enough for the steps to come.
  return FurthestOff(estimate.state, problem.observed) < kLongestStepMm * unit;
}

// A marker that is somewhere else must not cost the frame: where there is no answer, or one that does not
// come to rest, those that are isolated are left out. What came of all markers stands if that leads nowhere.
bool SkinEstimator::SolveWithoutIsolated(SkinProblem& problem, SkinEstimate& estimate) {
  bool is_solved = Solve(problem, estimate);
  for (const double most : {kSurelyIsolated, kPerhapsIsolated}) {
    if ((is_solved && estimate.unsettled_mm == 0) || IsSpent(estimate)) return is_solved;
    SkinProblem without = problem;
    const int hidden = HideIsolated(mechanics_.model(), problem.untouched.markers_mm, most,
                                    mechanics_.length_unit(), without.observed);
    if (hidden == 0) continue;
    if (hidden > kMostIsolated * mechanics_.marker_count()) return is_solved;
    const bool was_solved = is_solved;
    is_solved = Solve(without, estimate);
    if (was_solved && !is_solved) {
      estimate.work = {};  // what was found is found again, whatever has been spent
      return Solve(problem, estimate);
    }
    problem.observed = without.observed;
  }
  return is_solved;
}

}  // namespace taclink
