#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "server/config/regulator_options.h"
#include "server/pressure/pressure_actuator.h"

namespace taclink::server {

/// Causes of a trip, in the order of the API's PressureTripCause.
enum class PressureTripCause : uint8_t {
  kOverPressure,
  kUnderPressure,
  kSensorLost,
  kNotFollowing,
  kJump,
  kLeak,
  kDevice,
  kLoopStalled,
};

/// A trip: why and when the valve was closed.
struct PressureTrip {
  PressureTripCause cause = PressureTripCause::kOverPressure;
  std::string text;  ///< what was measured, the limit, and what to do
  /// kPa; s for kSensorLost and kLoopStalled, a share for kLeak; none for kDevice and for a lost line.
  std::optional<double> measured = {}, limit = {};
  int64_t utc_ns = 0;  ///< when the valve was closed
};

/// Factor from the unit of a trip's `measured` and `limit` to SI: Pa, s or none.
double TripUnitInSi(PressureTripCause cause);

/// Checks the readings of a regulator against its setpoint. Plain state: no clock, no thread.
class PressureGuard {
 public:
  PressureGuard(const PressureTripLimits& limits, std::chrono::milliseconds stale_after);

  /// The controller's command at one moment.
  struct Moment {
    int64_t now_ns = 0;                       ///< monotonic
    std::optional<double> setpoint_kpa = {};  ///< none: the valve is closed
    double ramp_kpa_per_s = 0;                ///< largest rate of the setpoint
    bool is_holding = false;                  ///< the setpoint has reached the target
  };

  /// Forgets the previous readings: the valve opens or closes now.
  void Restart();
  /// Checks a new reading. While the valve is closed, only over-pressure counts: the skin may be vented at
  /// any rate.
  std::optional<PressureTrip> OnReading(const RegulatorReading& reading, const Moment& moment);
  /// Checks the age of the newest reading; none: there was none yet.
  std::optional<PressureTrip> OnTime(const std::optional<RegulatorReading>& newest, const Moment& moment);
  /// Checks a reading against the limits of over- and under-pressure. The text says which one it exceeds;
  /// none: within both.
  std::optional<PressureTrip> OutsideLimits(const RegulatorReading& reading) const;

 private:
  std::optional<PressureTrip> Jump(const RegulatorReading& reading, const Moment& moment) const;
  std::optional<PressureTrip> Leak(const RegulatorReading& reading, const Moment& moment);
  std::optional<PressureTrip> NotFollowing(const RegulatorReading& reading, const Moment& moment);

  // Constant after construction.
  const PressureTripLimits limits_;
  const double stale_s_;

  std::optional<RegulatorReading> before_;  // previous reading since the valve opened
  std::optional<int64_t> opened_ns_;        // first moment with an open valve
  std::optional<int64_t> away_since_ns_;    // since then the reading is too far from the setpoint
  std::optional<int64_t> holding_since_ns_;
  // While holding: an exponential mean with the time constant leak_s.
  double effort_sum_ = 0, effort_weight_ = 0;
};

}  // namespace taclink::server
