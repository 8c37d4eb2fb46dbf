#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <string>

#include "sensing/yaml/fields.h"

// The section `pressure` of a link whose skin a pressure regulator inflates. Gauge pressures in kPa.

namespace taclink::server {

/// What a serial line may be set to.
inline constexpr std::array kBaudRates = {1200,  2400,  4800,   9600,   19200,
                                          38400, 57600, 115200, 230400, 921600};

/// The highest pressure that a regulator may be configured for, kPa. The estimator is validated up to it
/// (docs/measurements.md).
inline constexpr double kHighestRegulatedKpa = 2.5;

/// Limits beyond which the controller closes the valve and vents the skin.
struct PressureTripLimits {
  double over_kpa = 2, under_kpa = -0.2;  ///< of a reading
  double jump_kpa = 0.4;                  ///< between two readings, beyond what the ramp explains
  double follow_kpa = 0.3, follow_s = 1;  ///< distance from the setpoint, for so long
  double leak_effort = 0.5, leak_s = 3;   ///< mean share of the valve's range while the pressure is held
  void Describe(FieldVisitor& visit) {
    visit("over_kpa", over_kpa, {0.01, kHighestRegulatedKpa}, "A reading above it.");
    visit("under_kpa", under_kpa, {-100, 0}, "A reading below it.");
    visit("jump_kpa", jump_kpa, {0.01, 100}, "A change between two readings beyond that of the ramp.");
    visit("follow_kpa", follow_kpa, {0.01, 100}, "A distance of the reading from the setpoint,");
    visit("follow_s", follow_s, {0.05, 60}, "... that lasts so long.");
    visit("leak_effort", leak_effort, {0.01, 1}, "Share of the valve's range to hold a pressure,");
    visit("leak_s", leak_s, {0.1, 600}, "... as a mean over so long. Only of regulators that report it.");
  }
};

/// Limits of the setpoint and of its changes.
struct RegulatorOptions {
  double min_kpa = 0, max_kpa = 1.5;
  double ramp_kpa_per_s = 0.5;
  PressureTripLimits trips = {};
  void Describe(FieldVisitor& visit) {
    visit("min_kpa", min_kpa, {0, kHighestRegulatedKpa}, "Lowest setpoint.");
    visit("max_kpa", max_kpa, {0.01, kHighestRegulatedKpa}, "Highest setpoint.");
    visit.Check(min_kpa < max_kpa, "min_kpa", "must be below max_kpa", {"max_kpa"});
    visit("ramp_kpa_s", ramp_kpa_per_s, {0.001, 10}, "Fastest change of the setpoint.");
    visit("trips", trips, "Limits that close the valve and vent the skin (docs/pressure.md).");
    visit.Check(trips.over_kpa > max_kpa, "trips", "has an over_kpa that is not above max_kpa", {"max_kpa"});
  }
};

/// The regulator of a simulated link. Its pressure approaches the setpoint in a first-order lag, at a limited
/// rate, and leaks: dp/dt = clamp((setpoint - p) / time_constant_s, +-slew) - leak * p.
struct SimulatedRegulatorOptions {
  double time_constant_s = 0.2, slew_kpa_per_s = 1, leak_per_s = 0.01;
  double noise_pa = 10, offset_pa = 0, gain_error = 0;  ///< of its sensor
  void Describe(FieldVisitor& visit) {
    visit("time_constant_s", time_constant_s, {0.01, 10}, "Of the first-order lag.");
    visit("slew_kpa_s", slew_kpa_per_s, {0.01, 1}, "Fastest change; the simulated skin follows to 1.");
    visit("leak_per_s", leak_per_s, {0, 10}, "Loss in kPa/s for each kPa.");
    visit("noise_pa", noise_pa, {0, 1000}, "Standard deviation of the sensor's noise.");
    visit("offset_pa", offset_pa, {-1000, 1000}, "Zero error of the sensor.");
    visit("gain_error", gain_error, {-0.5, 0.5}, "Relative error of the sensor's sensitivity.");
  }
};

/// A regulator inflates the skin and measures its pressure.
struct RegulatorPressureConfig {
  std::optional<std::string> device;  ///< none: simulated
  int baud = 115200;
  RegulatorOptions regulator = {};
  SimulatedRegulatorOptions simulation = {};
  void Describe(FieldVisitor& visit) {
    visit.Path("device", device, "Serial line of the regulator; not set: simulated, with the link.");
    visit("baud", baud, {}, "Rate of the line, a usual one from 1200 to 921600.");
    visit.Check(std::ranges::find(kBaudRates, baud) != kBaudRates.end(), "baud",
                "must be a usual rate from 1200 to 921600, as 115200");
    regulator.Describe(visit);
    visit("simulation", simulation, "The simulated regulator and its sensor.");
  }
};

}  // namespace taclink::server
