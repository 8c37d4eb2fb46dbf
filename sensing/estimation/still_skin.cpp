// Frames in which nothing has moved by more than noise: the part of SkinEstimator that need not look for
// contacts.
#include <algorithm>
#include <cmath>

#include "sensing/estimation/skin_estimator.h"

namespace taclink {
namespace {

// Below what any load has to explain (kHillGain of LoadEstimator): 3 x 3 markers show two thirds of a load.
constexpr double kStillMarkerChi2 = 20, kStillSumChi2 = 12;
// Of all numbers: what moves all markers alike, as cameras that have moved do, hides in each of them.
constexpr double kStillChi2PerDof = 1.5;

}  // namespace

// What a marker is off by, if it may be noise: else false.
bool SkinEstimator::AddIfNoise(int marker, const Vec3& error, const Mat3& information) {
  const double chi2 = error.dot(information * error);
  if (!(chi2 <= kStillMarkerChi2)) return false;
  noise_chi2_ += chi2;
  noise_markers_ += information.trace() > 0 ? 1 : 0;
  const Vec3& normal = mechanics_.mesh().normals[static_cast<size_t>(mechanics_.markers().node(marker))];
  const Vec3 weighed = information * normal;
  radial_pull_[marker] = weighed.dot(error);
  radial_weight_[marker] = weighed.dot(normal);
  return true;
}

// The markers are where the skin without loads has them, but for the cameras' noise: each by itself, over
// each 3 x 3 of them, over each ring, radially, and all together. A load that explains less than that would
// not be let in (kHillGain of LoadEstimator), so nothing has to be solved. True: the estimate is complete.
// The tangent is made where there is none, for the shape's covariance. Else nothing is allocated.
bool SkinEstimator::IsStill(const SkinObservation& observation, const UntouchedSkin& untouched,
                            const KnownLoads& measured, const KnownLoadsPrior& prior,
                            SkinEstimate& estimate) {
  if (options_.model == ForceModel::kLinear) return false;
  if (!ExplainByKnownLoads(observation.markers, untouched, measured, prior, estimate)) return false;
  if (estimate.loads.chi2_per_dof > kStillChi2PerDof || !AreNeighborsStill()) return false;
  Tangent& tangent = *still_;
  if (!tangent.is_prepared || !tangent.IsNear(untouched.about()) ||
      !tangent.loads.IsPreparedFor(observation.markers, prior)) {
    const SkinProblem problem = MakeProblem(observation, untouched, measured, prior, estimate.baseline_mm);
    if (!Remake(tangent, problem, untouched.state, {}, estimate)) return false;
  }
  used_ = &tangent;
  tangent.loads.ConcludeUntouched(observation.markers);
  Forget();
  estimate.loads.loads.clear();
  estimate.loads.region_chi2_per_dof = estimate.loads.camera_shift_mm = 0;
  estimate.loads.beside_mm.setZero(untouched.markers_mm.size());
  estimate.loads.by_cameras_mm.setZero(untouched.markers_mm.size());
  for (Eigen::VectorXd& by_camera_mm : estimate.loads.by_camera_mm) by_camera_mm.resize(0);
  estimate.loads.converged = true;
  estimate.loads.baseline_error.setZero();
  estimate.loads.known_covariance = tangent.loads.KnownCovariance();
  estimate.known_loads = KnownLoads::FromStacked(measured.Stacked() + estimate.loads.known_error);
  AddWeightError(untouched, estimate);
  estimate.state = untouched.state;
  estimate.displacements_mm = untouched.markers_mm;
  estimate.displacements_mm.noalias() +=
      untouched.markers_by_loads * (estimate.known_loads.Stacked() - untouched.loads.Stacked());
  estimate.model = options_.model.value_or(ForceModel::kPressurised);
  estimate.failure = EstimateFailure::kNone;
  return true;
}

// Least squares for the errors of the known loads alone, in units of the prior: sets the errors, and chi^2
// per number that they leave. False: a marker by itself is off by more than noise.
bool SkinEstimator::ExplainByKnownLoads(const MarkerObservations& observed, const UntouchedSkin& untouched,
                                        const KnownLoads& measured, const KnownLoadsPrior& prior,
                                        SkinEstimate& estimate) {
  using Shares = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, KnownLoads::kCount, 1>;
  using Information =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, KnownLoads::kCount, KnownLoads::kCount>;
  const Eigen::Index count = prior.now.cols();
  Information information = Information::Identity(count, count);
  Shares pull = Shares::Zero(count);
  const Vec4 beyond = untouched.loads.Stacked() - measured.Stacked();
  double chi2 = 0;
  noise_chi2_ = noise_markers_ = 0;
  for (int m = 0; m < mechanics_.marker_count(); ++m) {
    const Mat3& seen = observed.information[static_cast<size_t>(m)];
    const Vec3 error = observed.displacement_mm[static_cast<size_t>(m)] +
                       estimate.baseline_mm.segment<3>(3 * m) - untouched.markers_mm.segment<3>(3 * m);
    if (!AddIfNoise(m, error, seen)) return false;
    const Eigen::Matrix<double, 3, KnownLoads::kCount> by_loads =
        untouched.markers_by_loads.middleRows<3>(3 * m);
    const Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, KnownLoads::kCount> by = by_loads * prior.now;
    const Vec3 from_measured = error + by_loads * beyond, weighed = seen * from_measured;
    information.noalias() += by.transpose() * seen * by;
    pull.noalias() += by.transpose() * weighed;
    chi2 += from_measured.dot(weighed);
  }
  const Shares shares = information.llt().solve(pull);
  estimate.loads.known_error = prior.now * shares;
  estimate.loads.chi2_per_dof = (chi2 - pull.dot(shares)) / std::max(1, 3 * noise_markers_);
  return true;
}

bool SkinEstimator::AreNeighborsStill() const {
  const LinkModel& model = mechanics_.model();
  const int paths = model.markers.paths, rings = model.markers.rings();
  for (int ring = 0; ring < rings; ++ring) {
    double ring_pull = 0, ring_weight = 0;
    for (int path = 0; path < paths; ++path) {
      double pull = 0, weight = 0;
      for (int r = std::max(0, ring - 1); r <= std::min(rings - 1, ring + 1); ++r) {
        for (int p = path - 1; p <= path + 1; ++p) {
          const int m = model.MarkerIndex((p + paths) % paths, r);
          pull += radial_pull_[m];
          weight += radial_weight_[m];
        }
      }
      if (pull * pull > kStillSumChi2 * weight) return false;
      ring_pull += radial_pull_[model.MarkerIndex(path, ring)];
      ring_weight += radial_weight_[model.MarkerIndex(path, ring)];
    }
    if (ring_pull * ring_pull > kStillSumChi2 * ring_weight) return false;
  }
  return true;
}

// The markers are where they were when contacts were last looked for, but for the noise of both frames and
// for what a little change of the known loads does. The test is that of an untouched skin.
bool SkinEstimator::IsStanding(const SkinObservation& observation, const UntouchedSkin& untouched,
                               const KnownLoadsPrior& prior) {
  if (!solved_ || IsFirstOrder() || !used_->is_prepared || !still_->is_prepared ||
      !still_->IsNear(untouched.about()))
    return false;
  const SkinObservation& then = solved_->observation;
  if (observation.baseline_loads.Loads() != then.baseline_loads.Loads() ||
      !used_->loads.IsPreparedFor(observation.markers, prior))
    return false;
  const Eigen::VectorXd grown_mm =
      untouched.markers_by_loads * (untouched.loads.Stacked() - solved_->loads.Stacked());
  if (grown_mm.cwiseAbs().maxCoeff() > kStillReachMm * mechanics_.length_unit()) return false;
  noise_chi2_ = noise_markers_ = 0;
  for (int m = 0; m < mechanics_.marker_count(); ++m) {
    const auto i = static_cast<size_t>(m);
    const Mat3 &now = observation.markers.information[i], &before = then.markers.information[i];
    if (now.trace() > 0 && !(before.trace() > 0)) return false;  // what it tells is new
    const bool is_seen = now.trace() > 0 && before.trace() > 0;
    const Mat3 information = is_seen ? Mat3(0.25 * (now + before)) : Mat3::Zero();  // of the difference
    const Vec3 moved =
        observation.markers.displacement_mm[i] - then.markers.displacement_mm[i] - grown_mm.segment<3>(3 * m);
    if (!AddIfNoise(m, is_seen ? moved : Vec3::Zero(), information)) return false;
  }
  return noise_chi2_ <= kStillChi2PerDof * std::max(1, 3 * noise_markers_) && AreNeighborsStill();
}

// What balances the skin's forces is known from the last search: one step from the same state. False: that
// leads elsewhere.
bool SkinEstimator::SolveStanding(const SkinProblem& problem, SkinEstimate& estimate) {
  still_->loads.Hide(problem.observed);
  used_->skin.SetKnownLoads(problem.loads);
  estimate.model = solved_->model;
  double step_mm = 0;
  if (!Step(*used_, problem, UsualLimits(), estimate, step_mm)) return false;
  const std::vector<Vec3>&mids = estimate.state.mids_mm, &last = past_.last.mids_mm;
  const double most_mm = kStillReachMm * mechanics_.length_unit();
  return std::equal(mids.begin(), mids.end(), last.begin(), last.end(),
                    [&](const Vec3& a, const Vec3& b) { return (a - b).squaredNorm() < most_mm * most_mm; });
}

}  // namespace taclink
