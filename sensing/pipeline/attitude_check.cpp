#include "sensing/pipeline/attitude_check.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "sensing/pipeline/rest_loads.h"

namespace taclink {
namespace {

// So seldom that one frame in a hundred takes longer.
constexpr int64_t kIntervalNs = 3'000'000'000;
constexpr double kModelMps2 = 0.15;  // of the model's weight and stiffness, each component

double Angle(const Vec3& a, const Vec3& b) {
  return DegFromRad(std::atan2(a.cross(b).norm(), a.dot(b)));
}

}  // namespace

MeasuredLoads AttitudeCheck::LoadsOf(const MeasuredLoads& measured, int64_t exposure_ns) {
  exposure_ns_ = exposure_ns;
  tests_ = !measured.specific_force_covariance.isZero(0) && !IsAttitudeUnknown(measured) &&
           (disagreement_ || exposure_ns < tested_ns_ || exposure_ns - tested_ns_ >= kIntervalNs);
  MeasuredLoads loads = measured;
  if (tests_) loads.ForgetAttitude();
  return loads;
}

void AttitudeCheck::Observe(const MeasuredLoads& measured, const MeasuredLoads& baseline,
                            const SkinEstimate& estimate) {
  if (!tests_) {
    // A contradiction may leave no answer.
    if (estimate.failure != EstimateFailure::kNone) tested_ns_ = 0;
    if (IsAttitudeUnknown(measured)) disagreement_.reset();
    return;
  }
  tested_ns_ = exposure_ns_;
  // What presses may look like weight.
  if (estimate.failure != EstimateFailure::kNone || !estimate.loads.loads.empty()) return;
  const Vec3 skin_mps2 = estimate.known_loads.specific_force_mps2;
  const Mat3 covariance = measured.specific_force_covariance + baseline.specific_force_covariance +
                          estimate.loads.known_covariance.bottomRightCorner<3, 3>() +
                          kModelMps2 * kModelMps2 * Mat3::Identity();
  const Vec3 off = skin_mps2 - measured.specific_force_mps2;
  const double deviations = std::sqrt(off.dot(covariance.llt().solve(off)));
  disagreement_.reset();
  if (deviations <= kLimit) return;
  disagreement_ = {.skin_mps2 = skin_mps2,
                   .measured_mps2 = measured.specific_force_mps2,
                   .deviations = deviations,
                   .angle_deg = Angle(skin_mps2 - baseline.specific_force_mps2,
                                      measured.specific_force_mps2 - baseline.specific_force_mps2)};
}

}  // namespace taclink
