#include "server/pressure/pressure_sensor.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "sensing/core/thread_start.h"
#include "sensing/core/units.h"
#include "server/process/system_limits.h"

namespace taclink::server {
namespace {

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
      clock_(clock),
      backoff_(options.first_backoff),
      readings_(options.origin, options.stale_after, reader_ ? "the sensor" : "any client (UpdatePressure)") {
}

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
  const auto added = readings_.Add({.time_ns = reading->time_ns, .mpa = kpa * kMpaPerKpa});
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
  return readings_.Add({.time_ns = time_ns, .mpa = mpa});
}

void PressureSensor::SetTrouble(const std::string& trouble) {
  if (!readings_.SetTrouble(trouble)) return;
  if (trouble.empty()) {
    SPDLOG_INFO("link {}: the pressure sensor gives readings", name_);
  } else {
    SPDLOG_WARN("link {}: pressure sensor: {}", name_, trouble);
  }
}

}  // namespace taclink::server
