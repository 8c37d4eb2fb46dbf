#include "sensing/pipeline/known_loads_reasons.h"

#include <algorithm>
#include <cmath>

#include "sensing/core/similar_skin.h"
#include "sensing/pipeline/reason_text.h"

namespace taclink {
namespace {

constexpr double kPressureDeviations = 3;
// Standard deviations of a change of pressure that the skin's shape shows: the model's error, a share of the
// change (3 % was the most in the whole benchmark); and how far a sensor's offset changes, a share of its
// own.
constexpr double kModelShare = 0.02, kSensorShare = 0.1;
constexpr double kLeastChange = 2;  // of the pressure, in the sensor's standard deviations
constexpr double kStiffest = -0.9;  // smaller ratios are not explained by a modulus
// Where the specific force leaves markers uncertain by more, contacts of 0.02 N may be missed.
constexpr double kMostAttitudeErrorMm = 0.2;

void AddPressureReasons(const Evidence& evidence, LinkState& state) {
  if (state.pressure.stale)
    state.reasons.push_back({ReasonId::kPressureUnknown,
                             "the pressure is not known: " + state.pressure.trouble + "; check the sensor"});
  else if (!evidence.is_pressure_measured)
    state.reasons.push_back(
        {ReasonId::kPressureUnknown,
         "the pressure is not measured: forces hold for a skin that was slack when its baseline was taken; "
         "configure pressure_kpa (0 if it is never inflated), or a sensor"});
  if (!state.pressure_estimate) return;
  const MeasuredLoads &measured = evidence.measured, &baseline = evidence.baseline;
  const double now_mpa = state.pressure_estimate->mpa;
  const double baseline_off_mpa = std::abs(evidence.estimate.loads.baseline_error[0]),
               most_baseline_off_mpa = kPressureDeviations * baseline.pressure_sigma_mpa;
  const double off_mpa = std::abs(now_mpa - measured.pressure_mpa),
               most_off_mpa = kPressureDeviations * measured.pressure_sigma_mpa;
  if (baseline_off_mpa > most_baseline_off_mpa)
    state.reasons.push_back(
        {ReasonId::kPressureMismatch,
         ReasonText("the skin's shape shows %.3f kPa, and %.3f kPa when the baseline was taken; measured "
                    "were %.3f and %.3f kPa; check the sensor and the baseline's pressure, or tare",
                    1e3 * now_mpa, 1e3 * (baseline.pressure_mpa + evidence.estimate.loads.baseline_error[0]),
                    1e3 * measured.pressure_mpa, 1e3 * baseline.pressure_mpa),
         baseline_off_mpa, most_baseline_off_mpa});
  else if (off_mpa > most_off_mpa && evidence.is_pressure_measured)
    state.reasons.push_back(
        {ReasonId::kPressureMismatch,
         ReasonText(
             "the skin's shape shows %.3f kPa, the sensor %.3f kPa; check the sensor, its hose and the "
             "baseline's pressure",
             1e3 * now_mpa, 1e3 * measured.pressure_mpa),
         off_mpa, most_off_mpa});
}

// The change of pressure since the baseline that the skin's shape shows, less the measured one. What is
// measured of the two pressures, with standard deviations n and t, and a change with d that the shape shows
// of its own combine into the estimate's variance n^2 (d^2 + t^2) / (d^2 + t^2 + n^2); an error that both
// measurements share is no error of the change.
struct PressureChangeError {
  double off_mpa = 0, sigma_mpa = 0;
};
std::optional<PressureChangeError> ErrorOfPressureChange(const Evidence& evidence,
                                                         const PressureEstimate& estimate) {
  const MeasuredLoads &measured = evidence.measured, &baseline = evidence.baseline;
  const double variance = std::pow(estimate.sigma_mpa, 2), now = std::pow(measured.pressure_sigma_mpa, 2);
  // The estimator takes a baseline without pressure for exact.
  const double then = baseline.pressure_mpa != 0 ? std::pow(baseline.pressure_sigma_mpa, 2) : 0;
  if (!(variance < now)) return std::nullopt;  // the shape shows nothing
  const double shown = std::max(0.0, (variance * (now + then) - now * then) / (now - variance));
  // The estimate lies between what is measured and what the shape shows.
  const double by_shape = (now + then) / (now + then + shown);
  const double off_mpa = estimate.mpa - measured.pressure_mpa - evidence.estimate.loads.baseline_error[0];
  return PressureChangeError{off_mpa / by_shape, std::sqrt(shown)};
}

// Pressure and modulus widen the skin only by their ratio.
void AddStiffnessReason(const Evidence& evidence, LinkState& state) {
  if (!state.pressure_estimate || !evidence.is_pressure_measured || evidence.diagnosis) return;
  const MeasuredLoads &measured = evidence.measured, &baseline = evidence.baseline;
  const double sensor_mpa = std::max(measured.pressure_sigma_mpa, baseline.pressure_sigma_mpa);
  const double change_mpa = measured.pressure_mpa - baseline.pressure_mpa;
  if (!(std::abs(change_mpa) > kLeastChange * sensor_mpa)) return;
  // Under suction the equilibrium may be computed at a smaller one (SkinMechanics::Untouched).
  if (std::min(measured.pressure_mpa, baseline.pressure_mpa) < -sensor_mpa) return;
  const auto error = ErrorOfPressureChange(evidence, *state.pressure_estimate);
  if (!error) return;
  const double sigma_mpa = std::hypot(error->sigma_mpa, kModelShare * change_mpa, kSensorShare * sensor_mpa);
  if (!(std::abs(error->off_mpa) > kPressureDeviations * sigma_mpa)) return;
  const double share = error->off_mpa / change_mpa, sigma = sigma_mpa / std::abs(change_mpa);
  if (!(share > kStiffest)) return;
  const double modulus_mpa = evidence.model.material.youngs_modulus_mpa, factor = 1 / (1 + share);
  state.reasons.push_back(
      {ReasonId::kStiffnessMismatch,
       ReasonText(
           "since the baseline the skin's width has changed by %.0f %% %s than a pressure change of %+.3f "
           "kPa explains with the model's Young's modulus of %.4f MPa; the modulus may be %.4f +- %.4f MPa, "
           "or the sensor's scale is wrong; forces are off by the same share; compare the sensor with a "
           "gauge, or determine the modulus (taclink calibrate material)",
           100 * std::abs(share), share > 0 ? "more" : "less", 1e3 * change_mpa, modulus_mpa,
           modulus_mpa * factor, modulus_mpa * factor * factor * sigma),
       std::abs(share), kPressureDeviations * sigma});
}

void AddAttitudeReasons(const Evidence& evidence, LinkState& state) {
  constexpr const char* kRemedy =
      "check where the link is mounted (pose), the URDF, the joints' zeros and the sensor's frame";
  if (const auto& off = evidence.attitude) {
    state.reasons.push_back(
        {ReasonId::kAttitudeMismatch,
         ReasonText(
             "since the baseline the skin shows another change of attitude than is measured, %.0f deg off: "
             "(%.1f, %.1f, %.1f) instead of (%.1f, %.1f, %.1f) m/s2; the measured one is not used; %s",
             off->angle_deg, off->skin_mps2.x(), off->skin_mps2.y(), off->skin_mps2.z(),
             off->measured_mps2.x(), off->measured_mps2.y(), off->measured_mps2.z(), kRemedy),
         off->deviations, AttitudeCheck::kLimit});
    return;
  }
  const double deviations = AttitudeDeviations(evidence.measured, evidence.baseline, evidence.estimate.loads);
  if (deviations > AttitudeCheck::kLimit) {
    state.reasons.push_back(
        {ReasonId::kAttitudeMismatch,
         ReasonText("the skin contradicts the measured attitude by %.1f standard deviations; %s", deviations,
                    kRemedy),
         deviations, AttitudeCheck::kLimit});
    return;
  }
  const double limit_mm = kMostAttitudeErrorMm * LengthUnit(evidence.model);
  if (evidence.attitude_error_mm <= limit_mm) return;
  const std::string trouble = state.specific_force ? state.specific_force->trouble : "";
  state.reasons.push_back(
      {ReasonId::kAttitudeUnknown,
       ReasonText("the attitude is not measured, and the skin shows it only to %.1f mm of its sag: weak "
                  "contacts may be missed or off; %s",
                  evidence.attitude_error_mm,
                  trouble.empty() ? "send joint states, or the attitude (UpdateAttitude)" : trouble.c_str()),
       evidence.attitude_error_mm, limit_mm});
}

}  // namespace

void AddKnownLoadsReasons(const Evidence& evidence, LinkState& state) {
  AddPressureReasons(evidence, state);
  if (state.forces.converged) AddStiffnessReason(evidence, state);
  if (state.forces.converged) AddAttitudeReasons(evidence, state);
}

}  // namespace taclink
