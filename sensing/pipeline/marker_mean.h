#pragma once

#include <array>
#include <vector>

#include "sensing/core/markers.h"

namespace taclink {

/// The mean of labelled markers over frames, and how much they scatter.
class MarkerMean {
 public:
  explicit MarkerMean(int markers);

  void Clear();
  void Add(const LabelledMarkers& labels);
  /// Makes the mean; to be followed by Clear before more is added.
  void Finish();

  int frames() const { return frames_; }
  /// After Finish: markers that more than half of the frames show.
  const LabelledMarkers& markers() const { return mean_; }
  /// After Finish: of each marker's place from frame to frame, each axis, px^2; those seen once are left out.
  const std::vector<double>& variances_px2() const { return variances_px2_; }
  /// After Finish: the root of their median, px; 0: there are none.
  double noise_px() const { return noise_px_; }
  /// After Finish: too many markers were not where they were before.
  bool moved() const;

 private:
  LabelledMarkers mean_;                                   // sums until Finish
  std::array<std::vector<double>, kCameraCount> squares_;  // sums of the squared positions
  std::array<std::vector<int>, kCameraCount> counts_;      // how often each marker was seen
  int frames_ = 0;
  std::vector<double> variances_px2_;
  double noise_px_ = 0;
};

}  // namespace taclink
