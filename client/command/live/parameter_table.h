#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "client/command/cli/json.h"
#include "sensing/core/calibration_report.h"
#include "taclink/v1/tactile.pb.h"

namespace taclink::command {

/// From the wire's units to those of the domain.
std::vector<CalibrationParameter> ToParameters(const v1::CalibrationResult& result);

/// Value and standard deviation of every parameter, a column for each camera, in mm, degrees and px; of
/// repeated calibrations also their mean and scatter (table 4.1 of [duong2021]).
void PrintParameters(std::span<const CalibrationParameter> parameters, size_t repeats);

/// Likewise, an object for each parameter, in the domain's units (CalibrationParameter::unit).
Json ParametersJson(std::span<const CalibrationParameter> parameters);

}  // namespace taclink::command
