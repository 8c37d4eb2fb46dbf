#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "sensing/core/camera_model.h"
#include "sensing/core/geometry.h"

namespace taclink {

/// Standard deviation along an axis, the mean of all axes (root of the mean variance), px.
inline double SigmaOf(const Mat2& covariance_px2) {
  return std::sqrt(0.5 * covariance_px2.trace());
}

/// A bright spot that looks like a marker.
struct Detection {
  Vec2 center_px = Vec2::Zero();  ///< of the outline, shade inside taken out; pixel (0, 0) has (0, 0)
  double width_px = 0;            ///< of the upright bounding box
  double height_px = 0;
  double area_px2 = 0;
  Mat2 covariance_px2 = Mat2::Zero();  ///< of the centre
  bool clipped = false;                ///< touches the picture's edge, so the centre is biased

  double sigma_px() const { return SigmaOf(covariance_px2); }
};

/// All of one picture, in no order.
using Detections = std::vector<Detection>;

/// One marker in one picture.
struct MarkerObservation {
  bool seen = false;
  Vec2 center_px = Vec2::Zero();
  Mat2 covariance_px2 = Mat2::Zero();  ///< of the centre

  double sigma_px() const { return SigmaOf(covariance_px2); }
};

/// Per camera, by marker index (see LinkModel).
struct LabelledMarkers {
  std::array<std::vector<MarkerObservation>, kCameraCount> cameras;
};

}  // namespace taclink
