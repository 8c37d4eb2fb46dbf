#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "sensing/core/clock.h"
#include "server/pressure/pressure_actuator.h"
#include "server/simulation/regulated_air.h"

namespace taclink::server {

/// What is wrong with a simulated regulator, for tests and demonstrations.
struct RegulatorFaults {
  double leak_per_s = 0;                 ///< in addition
  std::optional<double> stuck_kpa = {};  ///< the valve regulates to this pressure, whatever is commanded
  double reading_offset_kpa = 0;         ///< in addition
  bool is_silent = false;                ///< sends no reading
  bool is_unplugged = false;             ///< its line fails
  std::string error = {};                ///< it reports this; empty: nothing
};

/// A pressure regulator and its sensor, simulated together with the air in the skin. Closes its valve when no
/// command has come for kDeviceWatchdog. The pressure follows the clock: it is advanced by whoever asks for
/// it. Any thread; shared by the regulator's controller and the simulation of the skin.
class SimulatedRegulator {
 public:
  static constexpr std::chrono::milliseconds kReadingPeriod{20};

  /// `seed`: of the sensor's noise.
  SimulatedRegulator(const SimulatedRegulatorOptions& options, uint64_t seed, Clock& clock);

  struct Air {
    double kpa = 0, kpa_per_s = 0;
  };
  /// The true pressure now, and how fast it changes.
  Air AirNow();
  void SetFaults(RegulatorFaults faults);

  // As PressureActuator.
  Result<void> Open();
  Result<void> Command(std::optional<double> kpa);
  Result<RegulatorReading> Read(std::chrono::milliseconds timeout);

 private:
  void AdvanceTo(int64_t now_ns);
  double Noise();

  // Constant after construction.
  const SimulatedRegulatorOptions options_;
  Clock& clock_;

  std::mutex mutex_;
  // Guarded by mutex_.
  RegulatedAir air_;
  RegulatorFaults faults_;
  std::optional<double> commanded_kpa_;  // none: vented
  int64_t commanded_ns_, advanced_ns_;
  int64_t next_reading_ns_;
  uint64_t noise_bits_;
};

/// The actuator for a controller, which shares the regulator.
std::unique_ptr<PressureActuator> MakeSimulatedActuator(std::shared_ptr<SimulatedRegulator> regulator);

}  // namespace taclink::server
