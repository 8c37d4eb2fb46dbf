#pragma once

#include <array>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"

namespace taclink {

/// Labels a rest picture before the cameras are calibrated. From the model's nominal rig only the orientation
/// is believed, and roughly: the principal point may be 60 px off, the roll up to half a path pitch, the
/// scale 30 %. At rest all paths are straight lines through one point, evenly spaced in angle, and all
/// markers of a ring are equally far from it; both are fitted to the detections.
/// Errors: kInvalidArgument, with what does not fit. For calibration, not for every frame: it allocates.
Result<std::vector<MarkerObservation>> LabelRestPicture(const LinkModel& model, CameraId id,
                                                        const Detections& detections);

/// The same for both pictures; fails if either does, and names the camera.
Result<LabelledMarkers> LabelRestPair(const LinkModel& model,
                                      const std::array<Detections, kCameraCount>& detections);

}  // namespace taclink
