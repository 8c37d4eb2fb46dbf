#pragma once

#include <optional>

#include "sensing/camera/rest_shape.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/link_state.h"
#include "sensing/core/markers.h"

namespace taclink {

/// Whether a camera has moved since its calibration, by rest images of the untouched skin: it was mounted
/// again, or knocked. `rig`: as calibrated. None: neither has, as far as the images tell (see IsLarge); of an
/// inflated skin, whose model's inflation is wrong by some percent, they tell less.
std::optional<Reason> FindMovedCameras(const RestShape& rest, const StereoRig& rig,
                                       const LabelledMarkers& labels);

}  // namespace taclink
