#pragma once

#include <optional>

#include "sensing/core/link_model.h"
#include "sensing/estimation/camera_evidence.h"

namespace taclink {

/// A part of one camera's view that hides or displaces markers: a hair, a drop or dirt on the lens.
struct ViewObstruction {
  CameraId camera = CameraId::kTop;
  int markers = 0;     ///< that are displaced in its image alone
  int marker = 0;      ///< the one that is displaced most
  double most_px = 0;  ///< by so much
};

/// Markers that one camera sees far from the estimated skin, and the other where it is. Errors of the
/// estimate show in both images, cameras that have moved displace all markers. One image may show some such
/// markers; the camera with the most of them is reported. Allocates nothing.
std::optional<ViewObstruction> FindViewObstruction(const LinkModel& model, const ImageResiduals& residuals);

}  // namespace taclink
