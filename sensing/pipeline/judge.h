#pragma once

#include <string>

#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "sensing/pipeline/state_estimator.h"

namespace taclink {

/// All that is known of how good a frame's answer is.
struct Evidence {
  const LinkModel& model;
  const std::string& camera_trouble;  ///< empty: none
  const std::string drift_advice;     ///< empty: the baseline has not drifted far
  PressureReading told;               ///< the pressure that was taken as told
  PressureReading baseline;           ///< and that of the baseline
  const SkinEstimate& estimate;
};

/// Sets status and reasons of a measured state, here alone; what can't be trusted is taken out of it.
void Judge(const Evidence& evidence, LinkState& state);

}  // namespace taclink
