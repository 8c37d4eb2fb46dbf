#include "server/pressure/pressure_sensor.h"

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

constexpr double kLargestMpa = 0.1;  // as the configuration's constant
constexpr std::chrono::milliseconds kPoll{100};

int64_t Ns(std::chrono::milliseconds duration) {
  return std::chrono::nanoseconds(duration).count();
}

}  // namespace

PressureSensor::PressureSensor(std::string name, std::unique_ptr<PressureReader> reader,
                               PressureSensorOptions options, Clock& clock)
    : name_(std::move(name)),
      reader_(std::move(reader)),
      options_(options),
      stale_ns_(Ns(options.stale_after)),
      clock_(clock),
      backoff_(options.first_backoff) {}

PressureSensor::~PressureSensor() {
  Stop();
}

void PressureSensor::Start() {
  if (!reader_) return;
  thread_ = MustStartThread("prs:" + name_, [this](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      try {
        Step(kPoll);
      } catch (const std::exception& e) {  // no memory: the next try may do better
        Failed({ErrorCode::kInternal, DescribeLimit(e)});
      }
    }
  });
}

void PressureSensor::Stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void PressureSensor::Step(std::chrono::milliseconds timeout) {
  const int64_t now = clock_.MonotonicNs();
  if (!open_ && now < retry_at_ns_)
    return clock_.SleepUntilMonotonicNs(std::min(retry_at_ns_, now + Ns(timeout)));
  if (!open_) {
    if (const auto opened = reader_->Open(); !opened) return Failed(opened.error());
    open_ = true;
    return;
  }
  const auto reading = reader_->Read(timeout);
  if (!reading) {
    if (reading.error().code == ErrorCode::kTimeout) return;
    if (reading.error().code == ErrorCode::kInvalidArgument) return SetTrouble(reading.error().message);
    return Failed(reading.error());
  }
  backoff_ = options_.first_backoff;  // only a reading proves that the sensor works
  const double kpa = options_.kpa_per_unit * reading->value + options_.offset_kpa;
  const auto added = Add(kpa * kMpaPerKpa, reading->time_ns);
  SetTrouble(added ? "" : added.error().message + "; check kpa_per_unit and offset_kpa");
}

void PressureSensor::Failed(const Error& error) {
  open_ = false;
  retry_at_ns_ = clock_.MonotonicNs() + Ns(backoff_);
  backoff_ = std::min(backoff_ * 2, options_.longest_backoff);
  SetTrouble(error.message + "; trying again");
}

Result<bool> PressureSensor::Tell(double mpa, int64_t time_ns) {
  if (reader_) return PressureSource::Tell(mpa, time_ns);
  return Add(mpa, time_ns);
}

Result<bool> PressureSensor::Add(double mpa, int64_t time_ns) {
  if (!std::isfinite(mpa) || std::abs(mpa) > kLargestMpa) {
    return Error{ErrorCode::kInvalidArgument,
                 fmt::format("a pressure of {:g} kPa is not within -100 and 100 kPa", mpa / kMpaPerKpa)};
  }
  const std::lock_guard lock(mutex_);
  if (readings_ > 0 && ring_[(readings_ - 1) % ring_.size()].time_ns >= time_ns) return false;
  ring_[readings_++ % ring_.size()] = {time_ns, mpa};
  return true;
}

void PressureSensor::SetTrouble(std::string trouble) {
  {
    const std::lock_guard lock(mutex_);
    if (trouble_ == trouble) return;
    trouble_ = trouble;
  }
  if (trouble.empty()) {
    SPDLOG_INFO("link {}: the pressure sensor gives readings", name_);
  } else {
    SPDLOG_WARN("link {}: pressure sensor: {}", name_, trouble);
  }
}

std::string PressureSensor::Silence(int64_t age_ns) const {
  if (!trouble_.empty()) return trouble_;
  const char* who = reader_ ? "the sensor" : "any client (UpdatePressure)";
  if (age_ns < 0) return fmt::format("no reading yet from {}", who);
  return fmt::format("no reading from {} for {:.1f} s", who, static_cast<double>(age_ns) * 1e-9);
}

// The newest reading before the exposure; a sensor that has only just begun has but later ones.
void PressureSensor::Apply(StereoFrame& frame) {
  PressureReport& report = frame.pressure;
  const int64_t exposure_ns = frame.times.exposure_monotonic_ns;
  report.origin = options_.origin;
  report.age_ns = -1;
  report.mpa = 0;
  const std::lock_guard lock(mutex_);
  const uint64_t kept = std::min<uint64_t>(readings_, ring_.size());
  for (uint64_t i = 1; i <= kept; ++i) {
    const Reading& reading = ring_[(readings_ - i) % ring_.size()];
    report.mpa = reading.mpa;
    report.age_ns = std::abs(exposure_ns - reading.time_ns);
    if (reading.time_ns <= exposure_ns) break;
  }
  report.stale = report.age_ns < 0 || report.age_ns > stale_ns_;
  frame.pressure_mpa = report.stale ? std::nullopt : std::optional(report.mpa);
  if (report.stale) {
    report.trouble = Silence(report.age_ns);
  } else {
    report.trouble.clear();
  }
}

}  // namespace taclink::server
