#pragma once

#include <span>
#include <vector>

#include "sensing/camera/calibration.h"
#include "sensing/core/calibration_report.h"
#include "sensing/core/camera_model.h"

namespace taclink {

/// Parameters of both cameras in the last of `calibrations`, with the scatter over all of them; all have the
/// same lens kinds. `nominal`: the model's cameras. Empty without calibrations.
std::vector<CalibrationParameter> ParametersOf(std::span<const CalibrationSummary> calibrations,
                                               const StereoRig& nominal);

}  // namespace taclink
