#include "sensing/acceptance/reading_collector.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace taclink {
namespace {

constexpr double kSampleS = 1;

}  // namespace

ReadingCollector::ReadingCollector(std::optional<Vec3> place_mm, double near_mm, bool keeps_held)
    : place_mm_(std::move(place_mm)), near_mm_(near_mm), keeps_held_(keeps_held) {}

void ReadingCollector::Add(const LinkState& state) {
  const int64_t now_ns = state.times.exposure_monotonic_ns;
  if (reading_.frames++ == 0) {
    first_ns_ = now_ns;
    reading_.utc_ns = state.times.exposure_utc_ns;
  }
  reading_.duration_s = 1e-9 * static_cast<double>(now_ns - first_ns_);
  AddReasons(state);
  if (state.pressure_mpa) {
    pressure_sum_mpa_ += *state.pressure_mpa;
    ++pressures_;
  }
  reading_.baseline_drift_mm = state.baseline.drift_mm;
  reading_.baseline_utc_ns = state.baseline.taken_utc_ns;
  if (!state.has_forces()) return;
  ++reading_.usable;
  reading_.total_force_n += state.total_force_n;
  AddLoad(state);
}

void ReadingCollector::AddLoad(const LinkState& state) {
  Load load;
  for (const Contact& contact : state.contacts) {
    const double force_n = contact.magnitude_n();
    if (place_mm_ && (contact.center_mm - *place_mm_).norm() > near_mm_) {
      reading_.others_n += force_n;
      continue;
    }
    load.frames = 1;
    load.force_n += force_n;
    load.moment_nmm += force_n * contact.center_mm;
    load.has_variance = load.has_variance && contact.force_covariance_n2.has_value();
    if (contact.force_covariance_n2)
      load.variance_n2 += contact.normal.dot(*contact.force_covariance_n2 * contact.normal);
  }
  if (keeps_held_) AddHeld(load.force_n);
  if (load.frames == 0 || !(load.force_n > 0)) return;
  ++load_.frames;
  load_.force_n += load.force_n;
  load_.force2_n2 += load.force_n * load.force_n;
  load_.moment_nmm += load.moment_nmm;
  load_.has_variance = load_.has_variance && load.has_variance;
  load_.variance_n2 += load.variance_n2;
}

void ReadingCollector::AddReasons(const LinkState& state) {
  for (const Reason& reason : state.reasons) {
    auto known = std::ranges::find(reading_.reasons, reason.id, &ReadingReason::id);
    if (known == reading_.reasons.end())
      known = reading_.reasons.insert(known, ReadingReason{.id = reason.id, .frames = 0, .text = {}});
    ++known->frames;
    known->text = reason.text;
  }
}

void ReadingCollector::AddHeld(double force_n) {
  const double time_s = reading_.duration_s;
  const double begun_s = kSampleS * static_cast<double>(reading_.held.size());
  if (time_s >= begun_s + kSampleS && second_frames_ > 0) {
    reading_.held.push_back({second_.time_s / second_frames_, second_.force_n / second_frames_});
    second_ = {};
    second_frames_ = 0;
  }
  second_.time_s += time_s;
  second_.force_n += force_n;
  ++second_frames_;
}

TrialReading ReadingCollector::Reading() const {
  TrialReading reading = reading_;
  if (pressures_ > 0) reading.pressure_mpa = pressure_sum_mpa_ / pressures_;
  if (second_frames_ > 0)
    reading.held.push_back({second_.time_s / second_frames_, second_.force_n / second_frames_});
  if (reading.usable == 0) return reading;
  reading.total_force_n /= reading.usable;
  reading.others_n /= reading.usable;
  reading.has_contact = 2 * load_.frames >= reading.usable && load_.frames > 0;
  if (!reading.has_contact) {
    // A contact in less than half of the frames counts as a phantom force.
    reading.others_n += load_.force_n / reading.usable;
    return reading;
  }
  // Divided by all usable frames: those without a contact lower the mean.
  const double n = reading.usable;
  reading.force_n = load_.force_n / n;
  reading.center_mm = load_.moment_nmm / load_.force_n;
  if (reading.usable > 1) {
    const double variance = (load_.force2_n2 - n * reading.force_n * reading.force_n) / (n - 1);
    reading.force_sd_n = std::sqrt(std::max(0.0, variance));
  }
  if (load_.has_variance) reading.stated_sigma_n = std::sqrt(load_.variance_n2 / load_.frames);
  return reading;
}

}  // namespace taclink
