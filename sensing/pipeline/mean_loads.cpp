#include "sensing/pipeline/mean_loads.h"

#include <algorithm>
#include <cstdio>

#include "sensing/core/frame.h"

namespace taclink {
namespace {

constexpr double kScatter = 6;  // standard deviations from the least to the most of some ten readings

}  // namespace

void MeanLoads::Add(const MeasuredLoads& reading) {
  least_mpa_ = count_ == 0 ? reading.pressure_mpa : std::min(least_mpa_, reading.pressure_mpa);
  most_mpa_ = count_ == 0 ? reading.pressure_mpa : std::max(most_mpa_, reading.pressure_mpa);
  last_ = reading;
  sum_ += reading.Loads().Stacked();
  ++count_;
}

std::string MeanLoads::Trouble() const {
  if (most_mpa_ - least_mpa_ <= kScatter * last_.pressure_sigma_mpa) return {};
  char text[96];
  std::snprintf(text, sizeof text, "the pressure changed from %.3f to %.3f kPa meanwhile; hold it",
                1e3 * least_mpa_, 1e3 * most_mpa_);
  return text;
}

MeasuredLoads MeanLoads::mean() const {
  MeasuredLoads mean = last_;
  const KnownLoads loads = KnownLoads::FromStacked(sum_ / std::max(1, count_));
  mean.pressure_mpa = ExactInPascals(loads.pressure_mpa);
  mean.specific_force_mps2 = loads.specific_force_mps2;
  return mean;
}

}  // namespace taclink
