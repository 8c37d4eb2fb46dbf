#include "server/pressure/pressure_guard.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace taclink::server {
namespace {

double SecondsBetween(int64_t from_ns, int64_t to_ns) {
  return static_cast<double>(to_ns - from_ns) * 1e-9;
}

}  // namespace

double TripUnitInSi(PressureTripCause cause) {
  switch (cause) {
    case PressureTripCause::kSensorLost:
    case PressureTripCause::kLoopStalled:
    case PressureTripCause::kLeak:
    case PressureTripCause::kDevice:
      return 1;
    case PressureTripCause::kOverPressure:
    case PressureTripCause::kUnderPressure:
    case PressureTripCause::kNotFollowing:
    case PressureTripCause::kJump:
      break;
  }
  return 1e3;
}

PressureGuard::PressureGuard(const PressureTripLimits& limits, std::chrono::milliseconds stale_after)
    : limits_(limits), stale_s_(std::chrono::duration<double>(stale_after).count()) {}

void PressureGuard::Restart() {
  before_.reset();
  opened_ns_.reset();
  away_since_ns_.reset();
  holding_since_ns_.reset();
  effort_sum_ = effort_weight_ = 0;
}

std::optional<PressureTrip> PressureGuard::OutsideLimits(const RegulatorReading& reading) const {
  if (reading.kpa > limits_.over_kpa)
    return PressureTrip{.cause = PressureTripCause::kOverPressure,
                        .text = fmt::format("over-pressure: {:.3f} kPa measured, limit {:.3f} kPa; check the "
                                            "supply and the valve",
                                            reading.kpa, limits_.over_kpa),
                        .measured = reading.kpa,
                        .limit = limits_.over_kpa};
  if (reading.kpa < limits_.under_kpa)
    return PressureTrip{
        .cause = PressureTripCause::kUnderPressure,
        .text = fmt::format("under-pressure: {:.3f} kPa measured, limit {:.3f} kPa; check the "
                            "sensor and its tube",
                            reading.kpa, limits_.under_kpa),
        .measured = reading.kpa,
        .limit = limits_.under_kpa};
  return std::nullopt;
}

std::optional<PressureTrip> PressureGuard::OnReading(const RegulatorReading& reading, const Moment& moment) {
  auto trip = OutsideLimits(reading);
  if (!moment.setpoint_kpa)
    return trip && trip->cause == PressureTripCause::kOverPressure ? trip : std::nullopt;
  if (!trip) trip = Jump(reading, moment);
  if (!trip) trip = Leak(reading, moment);
  if (!trip) trip = NotFollowing(reading, moment);
  before_ = reading;
  return trip;
}

std::optional<PressureTrip> PressureGuard::OnTime(const std::optional<RegulatorReading>& newest,
                                                  const Moment& moment) {
  if (!moment.setpoint_kpa) return std::nullopt;
  if (!opened_ns_) opened_ns_ = moment.now_ns;
  const int64_t since_ns = newest ? newest->time_ns : *opened_ns_;
  const double age_s = SecondsBetween(since_ns, moment.now_ns);
  if (age_s <= stale_s_) return std::nullopt;
  return PressureTrip{.cause = PressureTripCause::kSensorLost,
                      .text = fmt::format("sensor lost: no reading for {:.2f} s, limit {:.2f} s; check the "
                                          "regulator's power and line",
                                          age_s, stale_s_),
                      .measured = age_s,
                      .limit = stale_s_};
}

std::optional<PressureTrip> PressureGuard::Jump(const RegulatorReading& reading, const Moment& moment) const {
  if (!before_) return std::nullopt;
  const double span_s = std::max(0.0, SecondsBetween(before_->time_ns, reading.time_ns));
  const double change_kpa = std::abs(reading.kpa - before_->kpa);
  const double limit_kpa = limits_.jump_kpa + moment.ramp_kpa_per_s * span_s;
  if (change_kpa <= limit_kpa) return std::nullopt;
  return PressureTrip{
      .cause = PressureTripCause::kJump,
      .text = fmt::format("implausible jump: from {:.3f} to {:.3f} kPa within {:.3f} s, limit {:.3f} kPa; "
                          "check the sensor and its wiring",
                          before_->kpa, reading.kpa, span_s, limit_kpa),
      .measured = change_kpa,
      .limit = limit_kpa};
}

// Only the effort at a held pressure counts: that of a ramp does not indicate leaks.
std::optional<PressureTrip> PressureGuard::Leak(const RegulatorReading& reading, const Moment& moment) {
  if (!moment.is_holding || !reading.effort) {
    holding_since_ns_.reset();
    return std::nullopt;
  }
  if (!holding_since_ns_) {
    holding_since_ns_ = reading.time_ns;
    effort_sum_ = effort_weight_ = 0;
  }
  const double span_s = before_ ? std::max(0.0, SecondsBetween(before_->time_ns, reading.time_ns)) : 0;
  const double kept = std::exp(-span_s / limits_.leak_s);
  effort_sum_ = kept * effort_sum_ + (1 - kept) * *reading.effort;
  effort_weight_ = kept * effort_weight_ + (1 - kept);  // below 1 at first, so that the mean is unbiased
  if (SecondsBetween(*holding_since_ns_, reading.time_ns) < limits_.leak_s) return std::nullopt;
  const double mean_effort = effort_sum_ / effort_weight_;
  if (mean_effort <= limits_.leak_effort) return std::nullopt;
  return PressureTrip{
      .cause = PressureTripCause::kLeak,
      .text = fmt::format("leak: holding {:.3f} kPa takes {:.0f} % of the valve's range, limit "
                          "{:.0f} %; check the skin, its clamps and the tube",
                          *moment.setpoint_kpa, 100 * mean_effort, 100 * limits_.leak_effort),
      .measured = mean_effort,
      .limit = limits_.leak_effort};
}

std::optional<PressureTrip> PressureGuard::NotFollowing(const RegulatorReading& reading,
                                                        const Moment& moment) {
  const double away_kpa = reading.kpa - *moment.setpoint_kpa;
  if (std::abs(away_kpa) <= limits_.follow_kpa) {
    away_since_ns_.reset();
    return std::nullopt;
  }
  if (!away_since_ns_) away_since_ns_ = reading.time_ns;
  if (SecondsBetween(*away_since_ns_, reading.time_ns) <= limits_.follow_s) return std::nullopt;
  return PressureTrip{
      .cause = PressureTripCause::kNotFollowing,
      .text =
          fmt::format("the pressure does not follow: {:.3f} kPa measured at a setpoint of {:.3f} kPa, limit "
                      "{:.3f} kPa for {:g} s; check the valve, the supply and for a leak",
                      reading.kpa, *moment.setpoint_kpa, limits_.follow_kpa, limits_.follow_s),
      .measured = std::abs(away_kpa),
      .limit = limits_.follow_kpa};
}

}  // namespace taclink::server
