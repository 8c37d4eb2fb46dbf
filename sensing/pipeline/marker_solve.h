#pragma once

#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "sensing/pipeline/state_estimator.h"

namespace taclink {

/// The state of one moment from its markers' displacements alone, judged as a link's frames are. `shape` has
/// what is measured: displacements from the baseline, with their information. Unless it
/// `is_pressure_measured`, the shape tells the pressure of now.
LinkState SolveMarkers(const LinkModel& model, StateEstimator& estimator, LoadsPair loads, SkinShape shape,
                       bool is_pressure_measured = true);

}  // namespace taclink
