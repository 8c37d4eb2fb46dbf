#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <optional>

#include "sensing/pipeline/image_noise.h"

namespace taclink {

/// Detects a camera that blends each image with those before it (temporal noise reduction), by the noise of
/// images of a skin at rest. Of a first-order recursive filter, y(t) = a y(t-1) + (1 - a) x(t), noise
/// correlates by a^k over k images; a fixed pattern and compression correlate all images alike. One thread.
class TemporalSmoothing {
 public:
  /// At a = 0.2 a marker that moves by 1 mm between images is seen 0.2 mm behind.
  static constexpr double kLeastShare = 0.2;

  /// One image after the other. `is_rest`: of the skin at rest; the first of them begins a new measurement,
  /// whose result stays while others are taken.
  void Take(const cv::Mat& gray, bool is_rest);

  /// How much of an image comes from the one before (a), at least: rounding of the filtered image is noise
  /// that does not correlate. None: too little to matter, or not known.
  std::optional<double> share() const;

 private:
  static constexpr size_t kFar = 5;  // images between two whose noise is compared

  std::array<NoiseSample, kFar + 1> samples_;  // of the last images, by turns
  bool was_rest_ = false;
  size_t taken_ = 0;
  size_t compared_ = 0;
  double near_sum_ = 0, far_sum_ = 0;  // correlations with the image before, and with that kFar before
};

}  // namespace taclink
