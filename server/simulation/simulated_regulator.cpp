#include "server/simulation/simulated_regulator.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "sensing/core/geometry.h"
#include "sensing/simulation/random.h"

namespace taclink::server {
namespace {

constexpr const char* kRegulatorName = "simulated regulator";

int64_t NanosecondsOf(std::chrono::milliseconds duration) {
  return std::chrono::nanoseconds(duration).count();
}

class SimulatedActuator final : public PressureActuator {
 public:
  explicit SimulatedActuator(std::shared_ptr<SimulatedRegulator> regulator)
      : regulator_(std::move(regulator)) {}
  Result<void> Open() override { return regulator_->Open(); }
  Result<void> Command(std::optional<double> kpa) override { return regulator_->Command(kpa); }
  Result<RegulatorReading> Read(std::chrono::milliseconds timeout) override {
    return regulator_->Read(timeout);
  }

 private:
  const std::shared_ptr<SimulatedRegulator> regulator_;
};

}  // namespace

SimulatedRegulator::SimulatedRegulator(const SimulatedRegulatorOptions& options, uint64_t seed, Clock& clock)
    : options_(options),
      clock_(clock),
      air_(options),
      commanded_ns_(clock.MonotonicNs()),
      advanced_ns_(commanded_ns_),
      next_reading_ns_(commanded_ns_),
      noise_bits_(MixBits(seed)) {}

// The command that the valve obeys ends with the watchdog, so that a span is advanced in up to two parts.
void SimulatedRegulator::AdvanceTo(int64_t now_ns) {
  const auto advance = [this](int64_t to_ns) {
    if (to_ns <= advanced_ns_) return;
    air_.Advance(static_cast<double>(to_ns - advanced_ns_) * 1e-9);
    advanced_ns_ = to_ns;
  };
  const int64_t closes_ns = commanded_ns_ + NanosecondsOf(PressureActuator::kDeviceWatchdog);
  air_.SetExtraLeak(faults_.leak_per_s);
  air_.Command(faults_.stuck_kpa ? faults_.stuck_kpa : commanded_kpa_);
  if (commanded_kpa_ && !faults_.stuck_kpa && now_ns > closes_ns) {
    advance(closes_ns);
    commanded_kpa_.reset();
    air_.Command(std::nullopt);
  }
  advance(now_ns);
}

SimulatedRegulator::Air SimulatedRegulator::AirNow() {
  const std::lock_guard lock(mutex_);
  AdvanceTo(clock_.MonotonicNs());
  return {.kpa = air_.kpa(), .kpa_per_s = air_.kpa_per_s()};
}

void SimulatedRegulator::SetFaults(RegulatorFaults faults) {
  const std::lock_guard lock(mutex_);
  AdvanceTo(clock_.MonotonicNs());
  faults_ = std::move(faults);
}

Result<void> SimulatedRegulator::Open() {
  const std::lock_guard lock(mutex_);
  if (faults_.is_unplugged)
    return Error{ErrorCode::kUnavailable, std::string(kRegulatorName) + ": is unplugged"};
  next_reading_ns_ = clock_.MonotonicNs();
  return {};
}

Result<void> SimulatedRegulator::Command(std::optional<double> kpa) {
  const std::lock_guard lock(mutex_);
  if (faults_.is_unplugged)
    return Error{ErrorCode::kUnavailable, std::string(kRegulatorName) + ": is unplugged"};
  const int64_t now_ns = clock_.MonotonicNs();
  AdvanceTo(now_ns);
  commanded_kpa_ = kpa;
  commanded_ns_ = now_ns;
  return {};
}

Result<RegulatorReading> SimulatedRegulator::Read(std::chrono::milliseconds timeout) {
  const int64_t until_ns = clock_.MonotonicNs() + NanosecondsOf(timeout);
  int64_t due_ns = 0;
  {
    const std::lock_guard lock(mutex_);
    due_ns = faults_.is_silent || faults_.is_unplugged ? until_ns : next_reading_ns_;
  }
  clock_.SleepUntilMonotonicNs(std::min(due_ns, until_ns));
  const std::lock_guard lock(mutex_);
  const int64_t now_ns = clock_.MonotonicNs();
  if (faults_.is_unplugged)
    return Error{ErrorCode::kUnavailable, std::string(kRegulatorName) + ": is unplugged"};
  if (faults_.is_silent || now_ns < next_reading_ns_)
    return Error{ErrorCode::kTimeout, std::string(kRegulatorName) + ": no reading yet"};
  next_reading_ns_ = now_ns + NanosecondsOf(kReadingPeriod);
  if (!faults_.error.empty())
    return Error{ErrorCode::kFailedPrecondition,
                 std::string(kRegulatorName) + ": the regulator reports: " + faults_.error};
  AdvanceTo(now_ns);
  const double sensed_kpa = (1 + options_.gain_error) * air_.kpa() +
                            1e-3 * (options_.offset_pa + options_.noise_pa * Noise()) +
                            faults_.reading_offset_kpa;
  return RegulatorReading{.time_ns = now_ns, .kpa = sensed_kpa, .effort = air_.effort()};
}

// Box and Muller's transform of two uniform numbers.
double SimulatedRegulator::Noise() {
  const auto uniform = [this] { return UnitFromBits(noise_bits_ = MixBits(noise_bits_)); };
  const double radius = std::sqrt(-2 * std::log(1 - uniform()));
  return radius * std::cos(2 * kPi * uniform());
}

std::unique_ptr<PressureActuator> MakeSimulatedActuator(std::shared_ptr<SimulatedRegulator> regulator) {
  return std::make_unique<SimulatedActuator>(std::move(regulator));
}

}  // namespace taclink::server
