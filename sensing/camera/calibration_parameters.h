#pragma once

#include <span>
#include <vector>

#include "sensing/camera/calibration.h"
#include "sensing/core/calibration_report.h"
#include "sensing/core/camera_model.h"

namespace taclink {

/// Of both cameras of the last one of `calibrations`, which have the same lens kinds. `nominal`: the model's.
/// None of none.
std::vector<CalibrationParameter> ParametersOf(std::span<const CalibrationSummary> calibrations,
                                               const StereoRig& nominal);

}  // namespace taclink
