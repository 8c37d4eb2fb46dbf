#include "wire/convert.h"
#include "wire/units.h"

namespace taclink::wire {
namespace {

v1::BaselineOrigin OriginToWire(BaselineOrigin origin) {
  switch (origin) {
    case BaselineOrigin::kStart:
      return v1::BASELINE_ORIGIN_START;
    case BaselineOrigin::kCalibration:
      return v1::BASELINE_ORIGIN_CALIBRATION;
    case BaselineOrigin::kTare:
      return v1::BASELINE_ORIGIN_TARE;
    case BaselineOrigin::kForcedTare:
      return v1::BASELINE_ORIGIN_FORCED_TARE;
    case BaselineOrigin::kNone:
      break;
  }
  return v1::BASELINE_ORIGIN_UNSPECIFIED;
}

BaselineOrigin OriginFromWire(v1::BaselineOrigin origin) {
  for (const auto known : {BaselineOrigin::kStart, BaselineOrigin::kCalibration, BaselineOrigin::kTare,
                           BaselineOrigin::kForcedTare}) {
    if (OriginToWire(known) == origin) return known;
  }
  return BaselineOrigin::kNone;
}

v1::DriftState DriftToWire(DriftState state) {
  switch (state) {
    case DriftState::kFollowing:
      return v1::DRIFT_STATE_FOLLOWING;
    case DriftState::kHeld:
      return v1::DRIFT_STATE_HELD;
    case DriftState::kOff:
      break;
  }
  return v1::DRIFT_STATE_UNSPECIFIED;
}

DriftState DriftFromWire(v1::DriftState state) {
  for (const auto known : {DriftState::kFollowing, DriftState::kHeld}) {
    if (DriftToWire(known) == state) return known;
  }
  return DriftState::kOff;
}

}  // namespace

void Fill(const Baseline& baseline, v1::Baseline& out) {
  out.set_origin(OriginToWire(baseline.origin));
  out.set_taken_utc_ns(baseline.taken_utc_ns);
  out.set_calibrated_utc_ns(baseline.calibrated_utc_ns);
  out.set_drift_m(baseline.drift_mm * kMetresPerMm);
  out.set_drift_state(DriftToWire(baseline.drift_state));
  out.clear_missing_markers();
  for (const int marker : baseline.missing_markers) out.add_missing_markers(static_cast<uint32_t>(marker));
}

Baseline FromWire(const v1::Baseline& baseline) {
  return {.origin = OriginFromWire(baseline.origin()),
          .taken_utc_ns = baseline.taken_utc_ns(),
          .calibrated_utc_ns = baseline.calibrated_utc_ns(),
          .drift_mm = baseline.drift_m() / kMetresPerMm,
          .drift_state = DriftFromWire(baseline.drift_state()),
          .missing_markers = {baseline.missing_markers().begin(), baseline.missing_markers().end()}};
}

}  // namespace taclink::wire
