#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "sensing/core/clock.h"
#include "server/config/regulator_options.h"
#include "server/pressure/pressure_actuator.h"
#include "server/pressure/pressure_guard.h"
#include "server/pressure/pressure_readings.h"
#include "server/pressure/pressure_source.h"

namespace taclink::server {

/// In the order of the API's RegulatorState.
enum class RegulatorState : uint8_t {
  kClosed,   ///< the valve is closed and the skin vented
  kHolding,  ///< the setpoint has reached the target
  kRamping,  ///< the setpoint moves to the target
  kTripped,  ///< closed and vented because a limit was exceeded, until an operator resets it
};

/// A request of an operator.
struct PressureOrder {
  std::optional<double> kpa = {};             ///< gauge; none: close the valve and vent at once
  std::optional<double> ramp_kpa_per_s = {};  ///< none: the configured ramp, which is the maximum
  bool reset_trip = false;                    ///< ends the state kTripped
};

struct RegulatorStatus {
  RegulatorState state = RegulatorState::kClosed;
  std::optional<double> target_kpa = {};    ///< requested; none: the valve is closed
  std::optional<double> setpoint_kpa = {};  ///< commanded now, on its way to the target; likewise
  double ramp_kpa_per_s = 0;
  std::optional<RegulatorReading> reading = {};  ///< the newest
  double age_s = 0;                              ///< of the reading
  std::optional<PressureTrip> trip = {};         ///< in the state kTripped
  std::string trouble = {};                      ///< problem of the line or the readings; empty: none
};

struct PressureOrderResult {
  RegulatorStatus status;  ///< after the order
  bool ended_a_trip = false;
};

/// Sets the pressure inside a link's skin by a regulator, which is also the link's pressure sensor. Moves the
/// setpoint along a ramp, checks every reading (PressureGuard), and closes the valve when a limit is
/// exceeded.
///
/// A thread of its own ("prs:LINK") talks to the regulator, so that a hanging device blocks no other thread.
/// The thread repeats its command as a heartbeat: if it ends, stalls or dies, the device closes its valve by
/// itself (PressureActuator). All durations use the monotonic clock.
class PressureController final : public PressureSource {
 public:
  /// `name`: of the link, for the log.
  PressureController(std::string name, std::unique_ptr<PressureActuator> actuator,
                     const RegulatorOptions& options, std::chrono::milliseconds stale_after, Clock& clock);
  ~PressureController() override;

  /// Called on the controller's thread, without a lock, after a trip closed the valve. Set before Start.
  void OnTrip(std::function<void(const PressureTrip&)> observer) { on_trip_ = std::move(observer); }

  void Start() override;
  void Stop() override;  ///< closes the valve
  void Apply(StereoFrame& frame) override { readings_.Apply(frame); }
  Result<PressureController*> Controller() override { return this; }

  /// Never waits: the controller's thread executes the order within its next cycle. The newest order counts.
  /// Any thread. Errors: kInvalidArgument (outside the limits), kFailedPrecondition (tripped and not reset;
  /// no fresh reading, or one outside the limits of the trips), kUnavailable (the controller does not run).
  /// After an error nothing has changed.
  Result<PressureOrderResult> Set(const PressureOrder& order);
  RegulatorStatus Status() const;  ///< any thread
  const RegulatorOptions& options() const { return options_; }

  /// One cycle: moves the setpoint, sends it, and waits up to `timeout` for a reading. Start's thread repeats
  /// it; public for tests without that thread.
  void Step(std::chrono::milliseconds timeout);

 private:
  Result<void> CheckOrder(const PressureOrder& order) const;
  Result<void> CheckOpening(int64_t now_ns) const;
  PressureGuard::Moment MomentAt(int64_t now_ns) const;
  RegulatorStatus StatusAt(int64_t now_ns) const;
  void MoveSetpoint(double span_s);
  void Close(RegulatorState state);
  std::optional<PressureTrip> Advance(int64_t now_ns);
  std::optional<PressureTrip> LateCommand(int64_t now_ns) const;
  template <typename Judge>
  void Guarded(Judge judge);
  void TakeReading(const RegulatorReading& reading);
  void TakeError(const Error& error);
  void SendCommand(int64_t now_ns);
  void Failed(const Error& error);
  void SetTrouble(const std::string& trouble);

  // Constant after construction; on_trip_ after Start.
  const std::string name_;
  const std::unique_ptr<PressureActuator> actuator_;
  const RegulatorOptions options_;
  const std::chrono::milliseconds stale_after_;
  Clock& clock_;
  std::function<void(const PressureTrip&)> on_trip_;

  /// Used by Step's thread only.
  struct Line {
    bool is_open = false;
    int64_t retry_at_ns = 0;
    std::chrono::milliseconds backoff{0};
    std::optional<int64_t> sent_ns;
    std::optional<double> sent_kpa;  ///< none: vent
  };
  Line line_;

  PressureReadings readings_;

  mutable std::mutex mutex_;
  // Guarded by mutex_.
  RegulatorStatus status_;  // without age and trouble
  PressureGuard guard_;
  std::optional<int64_t> stepped_ns_;  // time of the last Step

  std::jthread thread_;
};

}  // namespace taclink::server
