#pragma once

#include <string>

#include "sensing/estimation/skin_estimator.h"

namespace taclink {

/// The pressure under which the frames of a baseline were taken, whose markers are a mean, too.
class MeanPressure {
 public:
  void Clear() { *this = {}; }
  void Add(const PressureReading& reading);

  /// Why these frames are no baseline: their readings differ by more than they scatter. Empty: none.
  std::string Trouble() const;
  /// With the deviation of the last reading: a sensor's offset is in all of them. Exact in Pa.
  PressureReading mean() const;

 private:
  double sum_mpa_ = 0, least_mpa_ = 0, most_mpa_ = 0, sigma_mpa_ = 0;
  int count_ = 0;
};

}  // namespace taclink
