#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sensing/camera/rest_shape.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"

namespace taclink {

/// Labels of one rest picture by where a camera that is nearly known should see each marker.
struct RestMatch {
  std::vector<MarkerObservation> markers;  ///< by marker index
  /// Of the whole spots that are no marker's, the most that lie equally far from the principal point: dirt
  /// lies anywhere, a ring that the model does not have all around.
  int unexplained = 0;
};

/// A spot is a marker's if each is the other's nearest and the spot is closer than a third of the way to the
/// marker's nearest neighbour in the picture. `with_moved`: what is left is matched alike, up to that
/// neighbour, unless it is within 2 px, which no touch is but a spot that is badly seen.
RestMatch MatchRestPicture(const RestShape& shape, const CameraModel& camera, const Detections& detections,
                           bool domes, bool with_moved = true);

/// The camera that a rest picture shows, and the labels by it. Fits the camera to labels and the labels to
/// the camera, by turns, until they stay: a tilted or shifted camera sees no even star, so that the first
/// labels may be partly wrong, or all wrong by one ring, which is tried too. None: no camera fits.
struct SettledCamera {
  CameraModel camera;
  RestMatch match;
  double score = 0;   ///< how many markers the image shows, less for a camera far off the nominal one
  double misfit = 1;  ///< of the last fit (CameraFit::misfit)
};
std::optional<SettledCamera> SettleCamera(const RestShape& shape, CameraId id,
                                          std::span<const MarkerObservation> labels,
                                          const Detections& detections, bool domes);

/// Why the model's grid is not what the pictures show: rings or paths that no picture shows, or spots where
/// the model has none. Empty: it is.
std::string GridTrouble(const LinkModel& model, const std::array<RestMatch, kCameraCount>& matches);

}  // namespace taclink
