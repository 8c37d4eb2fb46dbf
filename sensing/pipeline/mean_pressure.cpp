#include "sensing/pipeline/mean_pressure.h"

#include <algorithm>
#include <cstdio>

#include "sensing/core/frame.h"

namespace taclink {
namespace {

constexpr double kScatter = 6;  // standard deviations from the least to the most of some ten readings

}  // namespace

void MeanPressure::Add(const PressureReading& reading) {
  least_mpa_ = count_ == 0 ? reading.mpa : std::min(least_mpa_, reading.mpa);
  most_mpa_ = count_ == 0 ? reading.mpa : std::max(most_mpa_, reading.mpa);
  sigma_mpa_ = reading.sigma_mpa;
  sum_mpa_ += reading.mpa;
  ++count_;
}

std::string MeanPressure::Trouble() const {
  if (most_mpa_ - least_mpa_ <= kScatter * sigma_mpa_) return {};
  char text[96];
  std::snprintf(text, sizeof text, "the pressure changed from %.3f to %.3f kPa meanwhile; hold it",
                1e3 * least_mpa_, 1e3 * most_mpa_);
  return text;
}

PressureReading MeanPressure::mean() const {
  return {ExactInPascals(count_ == 0 ? 0 : sum_mpa_ / count_), sigma_mpa_};
}

}  // namespace taclink
