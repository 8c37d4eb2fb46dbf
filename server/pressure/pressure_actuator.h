#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include "sensing/core/result.h"

namespace taclink::server {

/// A reading of a pressure regulator.
struct RegulatorReading {
  int64_t time_ns = 0;                ///< monotonic
  double kpa = 0;                     ///< gauge
  std::optional<double> effort = {};  ///< share of the valve's range in use, 0 to 1; none: not reported
};

/// A pressure regulator: the valve that inflates and vents a skin, and its sensor. One thread
/// (PressureController's). No call waits longer than its timeout, whatever the device does.
///
/// Devices close their valve and vent by themselves after kDeviceWatchdog without a command, so that the skin
/// does not stay inflated if the server dies or the line is cut.
class PressureActuator {
 public:
  static constexpr std::chrono::milliseconds kDeviceWatchdog{500};

  virtual ~PressureActuator() = default;

  /// May be called again after any error. Errors: kUnavailable, kNotFound (both: retried later).
  virtual Result<void> Open() = 0;
  /// Sends the setpoint, kPa gauge; none: close the valve and vent. Repeated as a heartbeat. Errors:
  /// kUnavailable (the device does not take it: Open again).
  virtual Result<void> Command(std::optional<double> kpa) = 0;
  /// Waits for the next reading. Errors: kTimeout (call again), kInvalidArgument (not a message of a
  /// regulator: call again), kFailedPrecondition (an error reported by the device: call again), others (lost:
  /// Open again).
  virtual Result<RegulatorReading> Read(std::chrono::milliseconds timeout) = 0;
};

}  // namespace taclink::server
