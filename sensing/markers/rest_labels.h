#pragma once

#include <array>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"

namespace taclink {

/// Labels a rest picture before the cameras are calibrated: LabelPicture without looking again. Of the
/// model's nominal rig only the orientation is believed, the roll to half a path pitch, see PictureGrid.
/// Errors: kInvalidArgument, with what does not fit. For calibration, not for every frame: it allocates.
Result<std::vector<MarkerObservation>> LabelRestPicture(const LinkModel& model, CameraId id,
                                                        const Detections& detections);

/// The same for both pictures; fails if either does, and names the camera.
Result<LabelledMarkers> LabelRestPair(const LinkModel& model,
                                      const std::array<Detections, kCameraCount>& detections);

}  // namespace taclink
