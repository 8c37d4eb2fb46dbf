#include "server/pressure/pressure_readings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "sensing/core/units.h"

namespace taclink::server {
namespace {

constexpr double kLargestMpa = 0.1;  // as for a configured constant

}  // namespace

PressureReadings::PressureReadings(PressureOrigin origin, std::chrono::milliseconds stale_after,
                                   std::string who)
    : origin_(origin), stale_ns_(std::chrono::nanoseconds(stale_after).count()), who_(std::move(who)) {}

Result<bool> PressureReadings::Add(const PressureReading& reading) {
  if (!std::isfinite(reading.mpa) || std::abs(reading.mpa) > kLargestMpa) {
    return Error{
        ErrorCode::kInvalidArgument,
        fmt::format("a pressure of {:g} kPa is not within -100 and 100 kPa", reading.mpa / kMpaPerKpa)};
  }
  const std::lock_guard lock(mutex_);
  if (count_ > 0 && ring_[(count_ - 1) % ring_.size()].time_ns >= reading.time_ns) return false;
  ring_[count_++ % ring_.size()] = reading;
  return true;
}

bool PressureReadings::SetTrouble(std::string trouble) {
  const std::lock_guard lock(mutex_);
  if (trouble_ == trouble) return false;
  trouble_ = std::move(trouble);
  return true;
}

std::string PressureReadings::trouble() const {
  const std::lock_guard lock(mutex_);
  return trouble_;
}

std::optional<PressureReading> PressureReadings::Newest() const {
  const std::lock_guard lock(mutex_);
  if (count_ == 0) return std::nullopt;
  return ring_[(count_ - 1) % ring_.size()];
}

std::string PressureReadings::Silence(int64_t age_ns) const {
  if (!trouble_.empty()) return trouble_;
  if (age_ns < 0) return fmt::format("no reading yet from {}", who_);
  return fmt::format("no reading from {} for {:.1f} s", who_, static_cast<double>(age_ns) * 1e-9);
}

// Uses the newest reading before the exposure; a sensor that has just started has only later ones.
void PressureReadings::Apply(StereoFrame& frame) const {
  PressureReport& report = frame.pressure;
  const int64_t exposure_ns = frame.times.exposure_monotonic_ns;
  report.origin = origin_;
  report.age_ns = -1;
  report.mpa = 0;
  const std::lock_guard lock(mutex_);
  const uint64_t kept = std::min<uint64_t>(count_, ring_.size());
  for (uint64_t i = 1; i <= kept; ++i) {
    const PressureReading& reading = ring_[(count_ - i) % ring_.size()];
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
