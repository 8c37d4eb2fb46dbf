#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>

#include "sensing/core/clock.h"
#include "server/pressure/pressure_readings.h"
#include "server/pressure/pressure_source.h"

namespace taclink::server {

/// A number that a sensor gave, in its own unit.
struct RawReading {
  double value = 0;
  int64_t time_ns = 0;  ///< monotonic
};

/// Reads a sensor's numbers. One thread.
class PressureReader {
 public:
  virtual ~PressureReader() = default;
  /// Errors: kUnavailable, kNotFound (both: tried again). May be called again.
  virtual Result<void> Open() = 0;
  /// Waits for the next number. Errors: kTimeout (call again), kInvalidArgument (no number: call again),
  /// others (lost: Open again).
  virtual Result<RawReading> Read(std::chrono::milliseconds timeout) = 0;
};

struct PressureSensorOptions {
  PressureOrigin origin = PressureOrigin::kSerial;
  double kpa_per_unit = 1;
  double offset_kpa = 0;  ///< pressure = kpa_per_unit * number + offset_kpa
  std::chrono::milliseconds stale_after{1000};
  std::chrono::milliseconds first_backoff{100};
  std::chrono::milliseconds longest_backoff{2000};
};

/// The pressure as a sensor measures it. Its reader has a thread of its own, so that a sensor that hangs or
/// vanishes keeps nobody waiting; it is opened again with growing pauses.
class PressureSensor final : public PressureSource {
 public:
  /// `reader` null: clients tell the pressure. `name`: of the link, for the log.
  PressureSensor(std::string name, std::unique_ptr<PressureReader> reader, PressureSensorOptions options,
                 Clock& clock);
  ~PressureSensor() override;

  void Start() override;
  void Stop() override;
  void Apply(StereoFrame& frame) override { readings_.Apply(frame); }
  Result<bool> Tell(double mpa, int64_t time_ns) override;

  /// Does one thing that is due: opens the sensor, waits before the next try, or for a reading; for about
  /// `timeout`. What Start's thread does again and again; for tests that don't start it.
  void Step(std::chrono::milliseconds timeout);

 private:
  void Failed(const Error& error);
  void SetTrouble(const std::string& trouble);

  // Constant after construction.
  const std::string name_;
  const std::unique_ptr<PressureReader> reader_;
  const PressureSensorOptions options_;
  Clock& clock_;

  // Used by Step's thread only.
  bool open_ = false;
  int64_t retry_at_ns_ = 0;
  std::chrono::milliseconds backoff_;

  PressureReadings readings_;

  std::jthread thread_;
};

}  // namespace taclink::server
