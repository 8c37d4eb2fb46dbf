#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <vector>

#include "sensing/core/markers.h"

namespace taclink {

/// How much a camera's markers stand out from the skin around them, against how much they did in the rest
/// image: what a hazed or blurred lens, a weak lamp or a wrong exposure take away. Dents change it for some
/// markers, hence the median of all. One thread.
class ImageContrast {
 public:
  /// `gray`: CV_8UC1; empty: the camera gave none. `markers`: their labels, by marker.
  void SetRest(const cv::Mat& gray, std::span<const MarkerObservation> markers);

  /// 1: as at rest. None: fewer than a tenth of the markers can be compared.
  std::optional<double> Of(const cv::Mat& gray, std::span<const MarkerObservation> markers);

 private:
  struct AtRest {
    float radius_px = 0;  // of the circle halfway to the nearest marker, which lies on bare skin
    float contrast = 0;   // levels; 0: too little, or the marker is not seen
  };
  std::vector<AtRest> rest_;
  std::vector<double> ratios_;  // scratch
};

}  // namespace taclink
