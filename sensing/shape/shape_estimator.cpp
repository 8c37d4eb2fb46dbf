#include "sensing/shape/shape_estimator.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

constexpr int kMaxSteps = 5, kMaxReadmissions = 2, kMaxOpenings = 4;
constexpr double kFirstStray2 = 1;
constexpr int kLearnEvery = 4;                      // frames
constexpr double kLearnUp = 0.7, kLearnDown = 0.4;  // of the way, each time
constexpr double kOpenedKept = 0.7;                 // of the slack that opened, to the next frame
constexpr double kLonely = 40;                      // an outlier's chi^2 against that per number around it
constexpr double kConvergedMm = 0.1;                // a step leaves less than a tenth of itself
constexpr double kMostOpenedMm2 =
    400;  // slack as good as unlimited; more would only grow from frame to frame

}  // namespace

ShapeEstimator::ShapeEstimator(const LinkModel& model, const ShapeEstimatorOptions& options)
    : options_(options),
      basis_(model, options.basis),
      solver_(basis_, options.solver),
      markers_(static_cast<size_t>(basis_.markers())),
      opened_mm2_(markers_.size(), 0.0),
      covariances_(markers_.size(), Mat3::Zero()),
      stray2_(kFirstStray2) {
  slack_.setZero(3 * basis_.markers());
  u_ = slack_;
}

void ShapeEstimator::Reset() {
  solver_.Reset();
  u_.setZero();
  stray2_ = kFirstStray2;
  frames_since_stray_ = 0;
  std::fill(opened_mm2_.begin(), opened_mm2_.end(), 0.0);
}

void ShapeEstimator::SetPrior(const KnownPressure& pressure) {
  const double sigma =
      pressure.is_measured ? options_.pressure_sigma_mpa : options_.unknown_pressure_sigma_mpa;
  const double part = options_.pressure_part * pressure.mpa;
  solver_.SetPrior(pressure.mpa, std::hypot(sigma, part), std::abs(part), std::sqrt(stray2_) * StrayGrowth());
}

double ShapeEstimator::StrayGrowth() const {
  return 1 + solver_.displacements().cwiseAbs().maxCoeff() / options_.stray_doubles_at_mm;
}

// Quickly up, slowly down.
void ShapeEstimator::LearnStray() {
  if (++frames_since_stray_ < kLearnEvery) return;
  frames_since_stray_ = 0;
  const ShapeSolver::StrayEvidence seen = solver_.Stray();
  const double growth = StrayGrowth(), least2 = options_.least_stray * options_.least_stray;
  const double shown2 =
      std::clamp(seen.square / std::max(seen.numbers, 1.0) / (growth * growth), least2, 1.0);
  stray2_ += (shown2 > stray2_ ? kLearnUp : kLearnDown) * (shown2 - stray2_);
}

// Of the loads at a marker, only the one that moves it most counts.
void ShapeEstimator::SetSlack() {
  const Eigen::VectorXd& u = solver_.displacements();
  const double least2 = options_.least_slack_mm * options_.least_slack_mm;
  const double growth = StrayGrowth(), stray2 = stray2_ * growth * growth;
  for (int m = 0; m < basis_.markers(); ++m) {
    const double part = options_.slack_part * u.segment<3>(3 * m).norm();
    slack_.segment<3>(3 * m) = stray2 * basis_.Remainder(m).diagonal().array() +
                               (part * part + least2 + opened_mm2_[static_cast<size_t>(m)]);
  }
  for (size_t i = 0; i < solver_.fields().size(); ++i) {
    const int field = solver_.fields()[i], center = basis_.MarkerOf(field), paths = basis_.paths();
    const double part = options_.slack_at_field * solver_.PeakMm(i);
    for (int m = 0; m < basis_.markers(); ++m) {
      double nearness = basis_.Along(0)(center / paths, m / paths);
      if (!basis_.IsWave(field))
        nearness *= basis_.Around(0)(center / paths, std::abs(m % paths - center % paths));
      const double sigma = part * nearness;
      slack_.segment<3>(3 * m).array() += sigma * sigma;
    }
  }
}

void ShapeEstimator::Converge(Evidence& evidence) {
  for (int step = 0; step < kMaxSteps; ++step) {
    SetSlack();
    evidence.Evaluate(solver_.displacements(), slack_, markers_);
    if (solver_.Step(markers_) < kConvergedMm) break;
  }
  evidence.Evaluate(solver_.displacements(), slack_, markers_);
}

// One more load, or one observation less; false: all is explained.
bool ShapeEstimator::Improve(Evidence& evidence) {
  const Misfit worst = evidence.Worst();
  const double least = options_.load_significance * options_.load_significance;
  const ShapeSolver::Candidate best = solver_.BestField(markers_, least);
  if (worst.chi2 > options_.outlier_sigmas * options_.outlier_sigmas && worst.chi2 > best.gain &&
      worst.chi2 > kLonely * Neighbourhood(worst.marker, false)) {
    evidence.Drop(worst.observation);
    return true;
  }
  const size_t fields = solver_.fields().size();
  if (best.gain <= least) {
    // One field a frame is looked at without need.
    if (fields == 0 || looked_) return false;
    looked_ = true;
    const size_t one = ++turn_ % fields;
    return MoveLoad(one, one + 1);
  }
  return MoveLoad(0, fields) || solver_.AddField(best.field);
}

// Loads that came in while a contact was shallow, or elsewhere, may be beside it.
bool ShapeEstimator::MoveLoad(size_t begin, size_t end) {
  size_t moved = 0;
  ShapeSolver::Candidate best;
  for (size_t i = begin; i < end; ++i) {
    if (basis_.IsWave(solver_.fields()[i])) continue;
    const ShapeSolver::Candidate next = solver_.BestMove(i);
    if (next.gain <= best.gain) continue;
    best = next;
    moved = i;
  }
  if (best.gain <= options_.load_moved * options_.load_moved) return false;
  solver_.Move(moved, best.field);
  return true;
}

// chi^2 per observed number of a marker and its neighbours; or of the neighbours but for the worst, which may
// be an outlier too.
double ShapeEstimator::Neighbourhood(int marker, bool with_itself) const {
  const int paths = basis_.paths(), path = marker % paths, ring = marker / paths;
  double chi2 = 0, largest = 0;
  int numbers = 0, largest_numbers = 0;
  for (int r = std::max(0, ring - 1); r <= std::min(basis_.rings() - 1, ring + 1); ++r) {
    for (int step = -1; step <= 1; ++step) {
      if (!with_itself && r == ring && step == 0) continue;
      const int turned = path + step, at = turned < 0 ? paths - 1 : turned == paths ? 0 : turned;
      const int neighbour = r * paths + at;
      const MarkerEvidence& one = markers_[static_cast<size_t>(neighbour)];
      chi2 += one.chi2;
      numbers += one.numbers;
      if (one.chi2 <= largest) continue;
      largest = one.chi2;
      largest_numbers = one.numbers;
    }
  }
  if (!with_itself) {
    chi2 -= largest;
    numbers -= largest_numbers;
  }
  return numbers > 0 ? chi2 / numbers : 0;
}

// False: everything fits.
bool ShapeEstimator::OpenSlack() {
  bool opened = false;
  for (int m = 0; m < basis_.markers(); ++m) {
    const MarkerEvidence& one = markers_[static_cast<size_t>(m)];
    if (one.numbers == 0) continue;
    const double misfit = Neighbourhood(m, true);
    if (misfit <= options_.misfit_allowed) continue;
    double& opened_mm2 = opened_mm2_[static_cast<size_t>(m)];
    opened_mm2 = std::min(kMostOpenedMm2, opened_mm2 + (misfit - 1) * 3 / one.information.trace());
    opened = true;
  }
  return opened;
}

void ShapeEstimator::Pursue(Evidence& evidence) {
  while (rounds_ < options_.max_rounds && Improve(evidence)) {
    ++rounds_;
    Converge(evidence);
  }
}

void ShapeEstimator::Estimate(Evidence& evidence, const KnownPressure& pressure) {
  SetPrior(pressure);
  for (double& opened : opened_mm2_) opened *= kOpenedKept;
  Converge(evidence);
  rounds_ = 0;
  looked_ = false;
  Pursue(evidence);
  // What was dropped before the loads were found may fit now.
  for (int turn = 0; turn < kMaxReadmissions && evidence.dropped() > 0; ++turn) {
    Finish();
    if (!evidence.Readmit(u_, covariances_)) break;
    Converge(evidence);
    Pursue(evidence);
  }
  for (int turn = 0; turn < kMaxOpenings && OpenSlack(); ++turn) Converge(evidence);
  bool removed = false;
  while (solver_.RemoveWeakest(options_.load_kept)) {
    removed = true;
    evidence.Evaluate(solver_.displacements(), slack_, markers_);
    solver_.Step(markers_);
  }
  if (removed) Converge(evidence);
  LearnStray();
  Finish();
}

// The slack's own part follows what is left of the evidence.
void ShapeEstimator::Finish() {
  u_ = solver_.displacements();
  const auto covariances = solver_.Covariances();
  for (size_t m = 0; m < markers_.size(); ++m) {
    const auto at = 3 * static_cast<Eigen::Index>(m);
    const Vec3 slack = slack_.segment<3>(at);
    u_.segment<3>(at) += slack.cwiseProduct(markers_[m].pull);
    const Mat3 spared = slack.asDiagonal() * markers_[m].information;
    const Mat3 keep = Mat3::Identity() - spared;
    covariances_[m].noalias() = keep * covariances[m] * keep.transpose();
    covariances_[m] += keep * slack.asDiagonal();
  }
}

}  // namespace taclink
