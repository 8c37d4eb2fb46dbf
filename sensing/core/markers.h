#pragma once

#include <array>
#include <vector>

#include "sensing/core/camera_model.h"
#include "sensing/core/geometry.h"

namespace taclink {

/// A bright spot that looks like a marker.
struct Detection {
  Vec2 center_px = Vec2::Zero();  ///< intensity-weighted; pixel (0, 0)'s centre is at (0, 0)
  double width_px = 0;            ///< of the upright bounding box
  double height_px = 0;
  double area_px2 = 0;
  double sigma_px = 0;   ///< standard deviation of the centre, each axis
  bool clipped = false;  ///< touches the picture's edge, so the centre is biased
};

/// All of one picture, in no order.
using Detections = std::vector<Detection>;

/// One marker in one picture.
struct MarkerObservation {
  bool seen = false;
  Vec2 center_px = Vec2::Zero();
  double sigma_px = 0;  ///< standard deviation of the centre, each axis
};

/// Per camera, by marker index (see LinkModel).
struct LabelledMarkers {
  std::array<std::vector<MarkerObservation>, kCameraCount> cameras;
};

}  // namespace taclink
