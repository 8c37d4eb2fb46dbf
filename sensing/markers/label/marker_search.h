#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>

#include "sensing/core/markers.h"

namespace taclink {

/// Where to look for one marker between its neighbours on a path.
struct MarkerPlace {
  Vec2 center_px = Vec2::Zero();
  Vec2 along = Vec2::UnitX();  ///< unit, the path's direction in the picture
  double reach_px = 0;         ///< along the path, to either side: half the way to the neighbours
  double half_length_px = 0;   ///< of the marker along the path
  double half_width_px = 0;    ///< and across
};

struct MarkerFound {
  Detection detection;
  double contrast = 0;  ///< gray levels over what is beside it on the path
};

/// Looks for a bright spot between two darker gaps along the path, the background being a ramp between them:
/// finds dim markers in a glow, those that touch their neighbours, and those that the picture's edge cuts.
/// None: brightness only rises or falls, or by less than `min_contrast` (gray levels). `gray`: CV_8UC1.
std::optional<MarkerFound> FindMarkerAt(const cv::Mat& gray, const MarkerPlace& place, double min_contrast);

}  // namespace taclink
