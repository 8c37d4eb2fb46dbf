#include "server/messages/pressure_message.h"

namespace taclink::server {
namespace {

constexpr double kPascalsPerKpa = 1e3;

// Both enums number their values in the same order, those of the API from 1.
static_assert(static_cast<int>(RegulatorState::kClosed) + 1 == v1::REGULATOR_STATE_CLOSED);
static_assert(static_cast<int>(RegulatorState::kTripped) + 1 == v1::REGULATOR_STATE_TRIPPED);
static_assert(static_cast<int>(PressureTripCause::kOverPressure) + 1 ==
              v1::PRESSURE_TRIP_CAUSE_OVER_PRESSURE);
static_assert(static_cast<int>(PressureTripCause::kJump) + 1 == v1::PRESSURE_TRIP_CAUSE_JUMP);
static_assert(static_cast<int>(PressureTripCause::kLoopStalled) + 1 == v1::PRESSURE_TRIP_CAUSE_LOOP_STALLED);

void FillTrip(const PressureTrip& trip, v1::PressureTrip& out) {
  out.set_cause(static_cast<v1::PressureTripCause>(static_cast<int>(trip.cause) + 1));
  out.set_text(trip.text);
  const double scale = TripUnitInSi(trip.cause);
  if (trip.measured) out.set_measured(scale * *trip.measured);
  if (trip.limit) out.set_limit(scale * *trip.limit);
  out.set_utc_ns(trip.utc_ns);
}

}  // namespace

void Fill(const RegulatorStatus& status, const RegulatorOptions& options, v1::PressureRegulator& out) {
  out.set_state(static_cast<v1::RegulatorState>(static_cast<int>(status.state) + 1));
  if (status.target_kpa) out.set_target_pa(kPascalsPerKpa * *status.target_kpa);
  if (status.setpoint_kpa) out.set_setpoint_pa(kPascalsPerKpa * *status.setpoint_kpa);
  out.set_ramp_pa_per_s(kPascalsPerKpa * status.ramp_kpa_per_s);
  if (status.reading) {
    out.set_measured_pa(kPascalsPerKpa * status.reading->kpa);
    out.set_age_s(status.age_s);
    if (status.reading->effort) out.set_effort(*status.reading->effort);
  }
  if (status.trip) FillTrip(*status.trip, *out.mutable_trip());
  out.set_trouble(status.trouble);
  out.set_min_pa(kPascalsPerKpa * options.min_kpa);
  out.set_max_pa(kPascalsPerKpa * options.max_kpa);
  out.set_max_ramp_pa_per_s(kPascalsPerKpa * options.ramp_kpa_per_s);
}

}  // namespace taclink::server
