#include "sensing/pipeline/attitude_check.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "sensing/pipeline/rest_loads.h"

namespace taclink {
namespace {

// So seldom that one frame in a hundred takes longer.
constexpr int64_t kIntervalNs = 3'000'000'000, kContradictedIntervalNs = 500'000'000;
constexpr double kModelMps2 = 0.15;  // of the model's weight and stiffness, each component

// Between the changes since the baseline; where either has hardly changed, between the specific forces.
double AngleOff(const Vec3& skin, const Vec3& measured, const Vec3& baseline) {
  constexpr double kLeastChangeMps2 = 1;
  Vec3 a = skin - baseline, b = measured - baseline;
  if (std::min(a.norm(), b.norm()) < kLeastChangeMps2) a = skin, b = measured;
  return DegFromRad(std::atan2(a.cross(b).norm(), a.dot(b)));
}

}  // namespace

double AttitudeDeviations(const MeasuredLoads& measured, const MeasuredLoads& baseline,
                          const LoadEstimate& loads) {
  const Mat3 covariance = measured.specific_force_covariance + baseline.specific_force_covariance;
  if (covariance.isZero(0)) return 0;
  const Vec3 off = (loads.known_error - loads.baseline_error).tail<3>();
  return std::sqrt(std::max(0.0, off.dot(covariance.ldlt().solve(off))));
}

MeasuredLoads AttitudeCheck::LoadsOf(const MeasuredLoads& measured, int64_t exposure_ns) {
  exposure_ns_ = exposure_ns;
  const int64_t since_ns = exposure_ns - last_test_ns_;
  const bool is_due = since_ns < 0 || since_ns >= (is_contradicted_ ? kContradictedIntervalNs : kIntervalNs);
  is_testing_ = !measured.specific_force_covariance.isZero(0) && !IsAttitudeUnknown(measured) &&
                (disagreement_ || is_due);
  MeasuredLoads loads = measured;
  if (is_testing_) loads.ForgetAttitude();
  return loads;
}

void AttitudeCheck::Observe(const MeasuredLoads& measured, const MeasuredLoads& baseline,
                            const SkinEstimate& estimate) {
  const bool has_answer = estimate.failure == EstimateFailure::kNone;
  if (!is_testing_) {
    is_contradicted_ = !measured.specific_force_covariance.isZero(0) && !IsAttitudeUnknown(measured) &&
                       (!has_answer || AttitudeDeviations(measured, baseline, estimate.loads) > kLimit);
    if (IsAttitudeUnknown(measured)) disagreement_.reset();
    return;
  }
  last_test_ns_ = exposure_ns_;
  const bool was_contradicted = std::exchange(is_contradicted_, false);
  const bool is_touched = has_answer && !estimate.loads.loads.empty();
  if (!has_answer) return;
  const Vec3 skin_mps2 = estimate.known_loads.specific_force_mps2;
  const Mat3 covariance = measured.specific_force_covariance + baseline.specific_force_covariance +
                          estimate.loads.known_covariance.bottomRightCorner<3, 3>() +
                          kModelMps2 * kModelMps2 * Mat3::Identity();
  const Vec3 off = skin_mps2 - measured.specific_force_mps2;
  const double deviations = std::sqrt(off.dot(covariance.llt().solve(off)));
  const bool disagrees = deviations > kLimit;
  if (is_touched && !(disagrees && (was_contradicted || disagreement_))) return;
  disagreement_.reset();
  if (!disagrees) return;
  disagreement_ = {
      .skin_mps2 = skin_mps2,
      .measured_mps2 = measured.specific_force_mps2,
      .deviations = deviations,
      .angle_deg = AngleOff(skin_mps2, measured.specific_force_mps2, baseline.specific_force_mps2)};
}

}  // namespace taclink
