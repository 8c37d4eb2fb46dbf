#pragma once

#include <string>

#include "sensing/estimation/skin_estimator.h"

namespace taclink {

/// The known loads under which the frames of a baseline were taken, whose markers are a mean, too.
class MeanLoads {
 public:
  void Clear() { *this = {}; }
  void Add(const MeasuredLoads& reading);

  /// Why these frames are no baseline: their readings differ by more than they scatter. Empty: none.
  std::string Trouble() const;
  /// With the uncertainty of the last reading: a sensor's offset is in all of them. Pressure is exact in Pa.
  MeasuredLoads mean() const;

 private:
  Vec4 sum_ = Vec4::Zero();
  double least_mpa_ = 0, most_mpa_ = 0;
  MeasuredLoads last_;
  int count_ = 0;
};

}  // namespace taclink
