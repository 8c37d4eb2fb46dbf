#include "server/pressure/pressure_controller.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

#include "sensing/core/thread_start.h"
#include "sensing/core/units.h"
#include "server/process/system_limits.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kCycle{20};
constexpr milliseconds kHeartbeat{100};  // a fifth of the device's watchdog
constexpr milliseconds kCommandGap{20};  // shortest interval between commands of a moving setpoint
constexpr milliseconds kFirstRetry{100}, kLongestRetry{2000};
// A device without commands for its watchdog time has vented by itself: the next setpoint would fill the skin
// without a ramp. The limit is lower, since the line takes time as well.
constexpr milliseconds kLongestStall = PressureActuator::kDeviceWatchdog * 7 / 10;

int64_t NsOf(milliseconds duration) {
  return std::chrono::nanoseconds(duration).count();
}

double SecondsOf(int64_t ns) {
  return static_cast<double>(ns) * 1e-9;
}

Error Refused(std::string message) {
  return {ErrorCode::kFailedPrecondition, std::move(message)};
}

}  // namespace

PressureController::PressureController(std::string name, std::unique_ptr<PressureActuator> actuator,
                                       const RegulatorOptions& options, milliseconds stale_after,
                                       Clock& clock)
    : name_(std::move(name)),
      actuator_(std::move(actuator)),
      options_(options),
      stale_after_(stale_after),
      clock_(clock),
      readings_(PressureOrigin::kRegulator, stale_after, "the regulator"),
      guard_(options.trips, stale_after) {
  status_.ramp_kpa_per_s = options.ramp_kpa_per_s;
}

PressureController::~PressureController() {
  Stop();
}

void PressureController::Start() {
  thread_ = MustStartThread("prs:" + name_, [this](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      try {
        Step(kCycle);
      } catch (const std::exception& e) {  // no memory: the next cycle may succeed
        Failed({ErrorCode::kInternal, DescribeLimit(e)});
      }
    }
  });
}

void PressureController::Stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
  {
    const std::lock_guard lock(mutex_);
    if (status_.state != RegulatorState::kTripped) Close(RegulatorState::kClosed);
    stepped_ns_.reset();
  }
  // If this command fails, the device's watchdog closes the valve.
  if (std::exchange(line_.is_open, false)) static_cast<void>(actuator_->Command(std::nullopt));
}

Result<void> PressureController::CheckOrder(const PressureOrder& order) const {
  if (order.kpa && !(*order.kpa >= options_.min_kpa && *order.kpa <= options_.max_kpa)) {
    return Error{
        ErrorCode::kInvalidArgument,
        fmt::format("a setpoint of {:g} kPa is not within {:g} and {:g} kPa, the min_kpa and max_kpa "
                    "of the link's regulator",
                    *order.kpa, options_.min_kpa, options_.max_kpa)};
  }
  const double ramp = order.ramp_kpa_per_s.value_or(options_.ramp_kpa_per_s);
  if (!(ramp > 0 && ramp <= options_.ramp_kpa_per_s)) {
    return Error{ErrorCode::kInvalidArgument,
                 fmt::format("a ramp of {:g} kPa/s is not above 0 and at most {:g} kPa/s, the ramp_kpa_s of "
                             "the link's regulator",
                             ramp, options_.ramp_kpa_per_s)};
  }
  return {};
}

// A closed valve opens only with a fresh reading within the limits.
Result<void> PressureController::CheckOpening(int64_t now_ns) const {
  if (!stepped_ns_ || now_ns - *stepped_ns_ > NsOf(kLongestStall))
    return Error{ErrorCode::kUnavailable,
                 "the regulator of link '" + name_ + "' is not controlled now; try again, or see the log"};
  const RegulatorStatus status = StatusAt(now_ns);
  if (!status.reading || status.age_s > SecondsOf(NsOf(stale_after_))) {
    return Refused("the regulator of link '" + name_ + "' gives no reading" +
                   (status.trouble.empty() ? std::string() : " (" + status.trouble + ")") +
                   "; the valve stays closed: check its power and line");
  }
  if (const auto outside = guard_.OutsideLimits(*status.reading))
    return Refused("the valve of link '" + name_ + "' stays closed: " + outside->text);
  return {};
}

Result<PressureOrderResult> PressureController::Set(const PressureOrder& order) {
  if (auto good = CheckOrder(order); !good) return good.error();
  const int64_t now_ns = clock_.MonotonicNs();
  const std::lock_guard lock(mutex_);
  const bool tripped = status_.state == RegulatorState::kTripped;
  if (tripped && !order.reset_trip && order.kpa) {
    return Refused("the regulator of link '" + name_ +
                   "' has tripped and its valve is closed: " + status_.trip->text +
                   "; remove the cause, then set reset_trip (taclink pressure set --reset)");
  }
  if (!order.kpa) {
    if (!tripped || order.reset_trip) Close(RegulatorState::kClosed);
    return PressureOrderResult{StatusAt(now_ns), tripped && order.reset_trip};
  }
  if (!status_.setpoint_kpa) {
    if (auto good = CheckOpening(now_ns); !good) return good.error();
    Close(RegulatorState::kClosed);
    status_.setpoint_kpa = std::clamp(status_.reading->kpa, 0.0, options_.max_kpa);
  }
  status_.target_kpa = order.kpa;
  status_.ramp_kpa_per_s = order.ramp_kpa_per_s.value_or(options_.ramp_kpa_per_s);
  MoveSetpoint(0);
  return PressureOrderResult{StatusAt(now_ns), tripped};
}

RegulatorStatus PressureController::Status() const {
  const int64_t now_ns = clock_.MonotonicNs();
  const std::lock_guard lock(mutex_);
  return StatusAt(now_ns);
}

RegulatorStatus PressureController::StatusAt(int64_t now_ns) const {
  RegulatorStatus status = status_;
  if (status.reading) status.age_s = SecondsOf(now_ns - status.reading->time_ns);
  status.trouble = readings_.trouble();
  if (stepped_ns_ && now_ns - *stepped_ns_ > NsOf(kLongestStall))
    status.trouble = fmt::format("the control loop has not run for {:.1f} s; the regulator closes by itself",
                                 SecondsOf(now_ns - *stepped_ns_));
  return status;
}

PressureGuard::Moment PressureController::MomentAt(int64_t now_ns) const {
  return {.now_ns = now_ns,
          .setpoint_kpa = status_.setpoint_kpa,
          .ramp_kpa_per_s = status_.ramp_kpa_per_s,
          .is_holding = status_.state == RegulatorState::kHolding};
}

void PressureController::MoveSetpoint(double span_s) {
  if (!status_.setpoint_kpa) return;
  const double most_kpa = status_.ramp_kpa_per_s * span_s;
  const double left_kpa = *status_.target_kpa - *status_.setpoint_kpa;
  // The last step sets the target itself: the sum of the steps would miss it by rounding.
  if (std::abs(left_kpa) <= most_kpa)
    *status_.setpoint_kpa = *status_.target_kpa;
  else
    *status_.setpoint_kpa += std::copysign(most_kpa, left_kpa);
  status_.state =
      *status_.setpoint_kpa == *status_.target_kpa ? RegulatorState::kHolding : RegulatorState::kRamping;
}

void PressureController::Close(RegulatorState state) {
  status_.state = state;
  status_.target_kpa.reset();
  status_.setpoint_kpa.reset();
  if (state != RegulatorState::kTripped) status_.trip.reset();
  guard_.Restart();
}

// Runs `judge` under the lock, and closes the valve if it returns a trip. The observer is called without the
// lock.
template <typename Judge>
void PressureController::Guarded(Judge judge) {
  std::optional<PressureTrip> trip;
  {
    const std::lock_guard lock(mutex_);
    trip = judge();
    if (!trip || status_.state == RegulatorState::kTripped) return;
    trip->utc_ns = clock_.UtcNs();
    Close(RegulatorState::kTripped);
    status_.trip = trip;
  }
  SPDLOG_WARN("link {}: pressure regulator: {}; the valve is closed and the skin vented", name_, trip->text);
  if (on_trip_) on_trip_(*trip);
}

std::optional<PressureTrip> PressureController::Advance(int64_t now_ns) {
  const double span_s = stepped_ns_ ? SecondsOf(now_ns - *stepped_ns_) : 0;
  stepped_ns_ = now_ns;
  if (!status_.setpoint_kpa) return std::nullopt;
  if (const double limit_s = SecondsOf(NsOf(kLongestStall)); span_s > limit_s)
    return PressureTrip{.cause = PressureTripCause::kLoopStalled,
                        .text = fmt::format("the control loop stood still for {:.2f} s, limit {:.2f} s; the "
                                            "machine was suspended or is overloaded",
                                            span_s, limit_s),
                        .measured = span_s,
                        .limit = limit_s};
  MoveSetpoint(span_s);
  return guard_.OnTime(status_.reading, MomentAt(now_ns));
}

// Time since the last command that the device took, whatever delayed the next one.
std::optional<PressureTrip> PressureController::LateCommand(int64_t now_ns) const {
  if (!status_.setpoint_kpa || !line_.sent_kpa || !line_.sent_ns) return std::nullopt;
  const double silent_s = SecondsOf(now_ns - *line_.sent_ns), limit_s = SecondsOf(NsOf(kLongestStall));
  if (silent_s <= limit_s) return std::nullopt;
  return PressureTrip{
      .cause = PressureTripCause::kLoopStalled,
      .text = fmt::format("the device got no command for {:.2f} s, limit {:.2f} s; the machine was "
                          "suspended or is overloaded",
                          silent_s, limit_s),
      .measured = silent_s,
      .limit = limit_s};
}

void PressureController::Step(milliseconds timeout) {
  const int64_t now_ns = clock_.MonotonicNs();
  Guarded([&] { return Advance(now_ns); });
  if (!line_.is_open && now_ns < line_.retry_at_ns)
    return clock_.SleepUntilMonotonicNs(std::min(line_.retry_at_ns, now_ns + NsOf(timeout)));
  if (!line_.is_open) {
    if (const auto opened = actuator_->Open(); !opened) return Failed(opened.error());
    line_ = {.is_open = true, .backoff = line_.backoff, .sent_ns = {}, .sent_kpa = {}};
  }
  Guarded([&] { return LateCommand(now_ns); });
  SendCommand(now_ns);
  if (!line_.is_open) return;
  const auto reading = actuator_->Read(timeout);
  if (reading) {
    TakeReading(*reading);
  } else {
    TakeError(reading.error());
  }
  if (line_.is_open) SendCommand(now_ns);  // immediately, if the valve was closed
}

void PressureController::TakeReading(const RegulatorReading& reading) {
  line_.backoff = milliseconds(0);  // only a reading proves that the device works
  // A reading that no frame can use, such as a saturated sensor's, still counts for the limits.
  Guarded([&] {
    status_.reading = reading;
    return guard_.OnReading(reading, MomentAt(reading.time_ns));
  });
  const auto added = readings_.Add({.time_ns = reading.time_ns, .mpa = reading.kpa * kMpaPerKpa});
  SetTrouble(added ? "" : added.error().message);
}

void PressureController::TakeError(const Error& error) {
  if (error.code == ErrorCode::kTimeout) return;
  if (error.code != ErrorCode::kInvalidArgument && error.code != ErrorCode::kFailedPrecondition)
    return Failed(error);
  SetTrouble(error.message);
  if (error.code == ErrorCode::kInvalidArgument) return;  // if no reading follows, kSensorLost does
  Guarded([&]() -> std::optional<PressureTrip> {
    if (!status_.setpoint_kpa) return std::nullopt;
    return PressureTrip{.cause = PressureTripCause::kDevice, .text = error.message};
  });
}

// Closing is sent at once, a heartbeat when it is due, and a moving setpoint no more often than a line of
// 9600 baud carries.
void PressureController::SendCommand(int64_t now_ns) {
  std::optional<double> kpa;
  {
    const std::lock_guard lock(mutex_);
    kpa = status_.setpoint_kpa;
  }
  const bool changed = !line_.sent_ns || kpa != line_.sent_kpa;
  const int64_t since_ns = line_.sent_ns ? now_ns - *line_.sent_ns : 0;
  const bool is_due = !line_.sent_ns || (changed && !kpa) || (changed && since_ns >= NsOf(kCommandGap)) ||
                      since_ns >= NsOf(kHeartbeat);
  if (!is_due) return;
  if (const auto sent = actuator_->Command(kpa); !sent) return Failed(sent.error());
  line_.sent_ns = now_ns;
  line_.sent_kpa = kpa;
}

void PressureController::Failed(const Error& error) {
  line_.is_open = false;
  line_.backoff = std::clamp(line_.backoff * 2, kFirstRetry, kLongestRetry);
  line_.retry_at_ns = clock_.MonotonicNs() + NsOf(line_.backoff);
  SetTrouble(error.message + "; trying again");
  Guarded([&]() -> std::optional<PressureTrip> {
    if (!status_.setpoint_kpa) return std::nullopt;
    return PressureTrip{.cause = PressureTripCause::kSensorLost,
                        .text = "the regulator cannot be reached: " + error.message +
                                "; check its power and line (it closes by itself)"};
  });
}

void PressureController::SetTrouble(const std::string& trouble) {
  if (!readings_.SetTrouble(trouble)) return;
  if (trouble.empty()) {
    SPDLOG_INFO("link {}: the pressure regulator gives readings", name_);
  } else {
    SPDLOG_WARN("link {}: pressure regulator: {}", name_, trouble);
  }
}

}  // namespace taclink::server
