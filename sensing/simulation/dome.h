#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "sensing/camera/projection.h"
#include "sensing/core/geometry.h"

namespace taclink {

/// A marker as it stands on the wall: half a ball.
struct Dome {
  Vec3 foot_mm = Vec3::Zero();  ///< centre of the flat side, on the inner wall
  Vec3 normal = Vec3::Zero();   ///< unit, of the wall, away from the axis: the dome stands the other way
  double radius_mm = 0;
  double level = 255;            ///< brightness where it faces the light
  Vec2 shift_px = Vec2::Zero();  ///< added to where it is seen

  bool operator==(const Dome&) const = default;
};

/// Where the centroid of the dome's silhouette is seen, without the shift. None: it turns its back, or is
/// beyond the lens.
std::optional<Vec2> SilhouetteCentroid(const Projector& camera, const Dome& dome);

/// The part of a picture of that size in which DrawDome may change something.
cv::Rect DomePlace(const Projector& camera, const Dome& dome, double blur_px, cv::Size size);

/// Draws the dome over an 8-bit picture: the affine image of half a ball at its place, lit from beside the
/// camera, with edges as soft as a Gaussian blur makes them. What lies outside the picture or turns its back
/// is not drawn. Returns DomePlace.
cv::Rect DrawDome(const Projector& camera, const Dome& dome, double blur_px, cv::Mat& gray);

}  // namespace taclink
