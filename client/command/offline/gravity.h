#pragma once

#include <string>

#include "sensing/core/known_loads.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"

namespace taclink::command {

/// Of "X,Y,Z", m/s^2. Errors: kInvalidArgument (none, or more than 100).
Result<Vec3> SpecificForceFrom(const std::string& text);

/// Sets the specific force by what a user gives: "X,Y,Z" in m/s^2, link frame, with `sigma_mps2` of each
/// component, or "unknown". Errors: kInvalidArgument.
Result<void> TakeGravity(const std::string& text, double sigma_mps2, MeasuredLoads& loads);

/// Errors: kFailedPrecondition (a specific force is given, but the model has no density).
Result<void> CheckWeight(const LinkModel& model, const std::string& text);

}  // namespace taclink::command
