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
bool SkinEstimator::IsStill(const SkinObservation& observation, const InflatedSkin& inflated,
                            const PressurePrior& prior, SkinEstimate& estimate) {
  if (options_.model == ForceModel::kLinear) return false;
  double told = 1 / (prior.sigma_mpa * prior.sigma_mpa), off = 0;
  noise_chi2_ = noise_markers_ = 0;
  for (int m = 0; m < mechanics_.marker_count(); ++m) {
    const Mat3& information = observation.markers.information[static_cast<size_t>(m)];
    const Vec3 error = observation.markers.displacement_mm[static_cast<size_t>(m)] +
                       estimate.baseline_mm.segment<3>(3 * m) - inflated.markers_mm.segment<3>(3 * m);
    if (!AddIfNoise(m, error, information)) return false;
    const Vec3 by = information * inflated.markers_mm_per_mpa.segment<3>(3 * m);
    told += by.dot(inflated.markers_mm_per_mpa.segment<3>(3 * m));
    off += by.dot(error);
  }
  const double chi2_per_dof = (noise_chi2_ - off * off / told) / std::max(1, 3 * noise_markers_);
  if (chi2_per_dof > kStillChi2PerDof || !AreNeighborsStill()) return false;
  Tangent& tangent = *still_;
  if (!tangent.is_prepared || !tangent.IsNear(inflated.state) ||
      !tangent.loads.IsPreparedFor(observation.markers, prior)) {
    const Eigen::VectorXd none = Eigen::VectorXd::Zero(mechanics_.site_count());
    const SkinProblem problem = MakeProblem(observation, inflated, prior, estimate.baseline_mm);
    if (!Remake(tangent, problem, inflated.state, none, estimate)) return false;
  }
  used_ = &tangent;
  tangent.loads.ConcludeUntouched(observation.markers);
  Forget();
  estimate.loads.loads.clear();
  estimate.loads.chi2_per_dof = chi2_per_dof;
  estimate.loads.region_chi2_per_dof = estimate.loads.camera_shift_mm = 0;
  estimate.loads.by_cameras_mm.setZero(inflated.markers_mm.size());
  for (Eigen::VectorXd& by_camera_mm : estimate.loads.by_camera_mm) by_camera_mm.resize(0);
  estimate.loads.converged = true;
  estimate.loads.pressure_error_mpa = off / told;
  estimate.loads.baseline_error_mpa = 0;
  estimate.loads.pressure_sigma_mpa = prior.sigma_mpa;
  estimate.state = inflated.state;
  estimate.displacements_mm = inflated.markers_mm + off / told * inflated.markers_mm_per_mpa;
  estimate.pressure_mpa = inflated.pressure_mpa + off / told;
  estimate.model = options_.model.value_or(ForceModel::kPressurised);
  estimate.failure = EstimateFailure::kNone;
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
// for what a little more pressure does. The test is that of an untouched skin.
bool SkinEstimator::IsStanding(const SkinObservation& observation, const InflatedSkin& inflated,
                               const PressurePrior& prior) {
  if (!solved_ || IsFirstOrder() || !used_->is_prepared || !still_->is_prepared ||
      !still_->IsNear(inflated.state))
    return false;
  const SkinObservation& then = solved_->observation;
  if (observation.baseline_pressure.mpa != then.baseline_pressure.mpa ||
      !used_->loads.IsPreparedFor(observation.markers, prior))
    return false;
  const double more_mpa = inflated.pressure_mpa - solved_->pressure_mpa;
  if (std::abs(more_mpa) * inflated.markers_mm_per_mpa.cwiseAbs().maxCoeff() >
      kStillReachMm * mechanics_.length_unit())
    return false;
  noise_chi2_ = noise_markers_ = 0;
  for (int m = 0; m < mechanics_.marker_count(); ++m) {
    const auto i = static_cast<size_t>(m);
    const Mat3 &now = observation.markers.information[i], &before = then.markers.information[i];
    if (now.trace() > 0 && !(before.trace() > 0)) return false;  // what it tells is new
    const bool is_seen = now.trace() > 0 && before.trace() > 0;
    const Mat3 information = is_seen ? Mat3(0.25 * (now + before)) : Mat3::Zero();  // of the difference
    const Vec3 moved = observation.markers.displacement_mm[i] - then.markers.displacement_mm[i] -
                       more_mpa * inflated.markers_mm_per_mpa.segment<3>(3 * m);
    if (!AddIfNoise(m, is_seen ? moved : Vec3::Zero(), information)) return false;
  }
  return noise_chi2_ <= kStillChi2PerDof * std::max(1, 3 * noise_markers_) && AreNeighborsStill();
}

// What balances the skin's forces is known from the last search: one step from the same state. False: that
// leads elsewhere.
bool SkinEstimator::SolveStanding(const SkinProblem& problem, SkinEstimate& estimate) {
  still_->loads.Hide(problem.observed);
  used_->skin.SetPressure(problem.pressure_mpa);
  estimate.model = solved_->model;
  double step_mm = 0;
  if (!Step(*used_, problem, estimate, step_mm)) return false;
  const std::vector<Vec3>&mids = estimate.state.mids_mm, &last = past_.last.mids_mm;
  const double most_mm = kStillReachMm * mechanics_.length_unit();
  return std::equal(mids.begin(), mids.end(), last.begin(), last.end(),
                    [&](const Vec3& a, const Vec3& b) { return (a - b).squaredNorm() < most_mm * most_mm; });
}

}  // namespace taclink
