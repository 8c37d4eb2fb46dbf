#pragma once

#include <Eigen/Core>
#include <optional>

#include "sensing/camera/rest_shape.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/link_state.h"
#include "sensing/core/markers.h"

namespace taclink {

/// Detects cameras that moved since their calibration (mounted again, or knocked), from rest images of the
/// untouched skin. `rig`: as calibrated; `errors_mm`: displacements of the markers by one standard deviation
/// of each error of the known loads, stacked, in columns: an unmeasured pressure looks like cameras that
/// moved along the axis. None: no large motion (see IsLarge). Less sensitive for an inflated skin, whose
/// modeled inflation has an error of some percent.
std::optional<Reason> FindMovedCameras(const RestShape& rest, const StereoRig& rig,
                                       const LabelledMarkers& labels, const Eigen::MatrixXd& errors_mm);

}  // namespace taclink
