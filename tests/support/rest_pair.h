#pragma once

#include <array>
#include <utility>

#include "sensing/markers/label/rest_labels.h"

namespace taclink {

/// LabelRestPicture for both images; the first error.
inline Result<LabelledMarkers> LabelRestPair(const LinkModel& model,
                                             std::array<Detections, kCameraCount> detections) {
  LabelledMarkers labelled;
  for (const CameraId id : kBothCameras) {
    auto seen = LabelRestPicture(model, id, detections[Index(id)]);
    if (!seen) return seen.error();
    labelled.cameras[Index(id)] = *std::move(seen);
  }
  return labelled;
}

}  // namespace taclink
