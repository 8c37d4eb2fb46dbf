#include "sensing/pipeline/known_loads_reasons.h"

#include <algorithm>
#include <cmath>

#include "sensing/core/similar_skin.h"
#include "sensing/pipeline/reason_text.h"

namespace taclink {
namespace {

constexpr double kPressureDeviations = 3;
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
  if (state.forces.converged) AddAttitudeReasons(evidence, state);
}

}  // namespace taclink
