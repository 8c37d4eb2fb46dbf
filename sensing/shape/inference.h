#pragma once

#include "sensing/core/link_model.h"
#include "sensing/core/skin_shape.h"

namespace taclink {

/// Gives the markers that no camera saw (MarkerSource::kInferred) a displacement, interpolated along the path
/// between the nearest known markers or the clamped ends, (4.33) and (4.34), and moves their positions from
/// where the baseline has them by it. `sigma_mm`: what their covariance says, each axis. On entry the
/// positions of these markers are the baseline's.
void InferUnseen(const LinkModel& model, double sigma_mm, SkinShape& shape);

}  // namespace taclink
