#pragma once

#include "sensing/core/link_model.h"
#include "sensing/core/skin_shape.h"
#include "sensing/shape/shape_estimator.h"

namespace taclink {

/// Gives the markers that nobody saw (MarkerSource::kInferred) the displacement that the skin's mechanics
/// make of the others' measured ones, with covariance, and moves their positions by it. On entry these
/// positions are those without displacement. The other markers stay as they are. Solves the shell: for single
/// shapes, not for streams.
void InferUnseen(const LinkModel& model, const KnownPressure& pressure, SkinShape& shape,
                 const ShapeEstimatorOptions& options = {});

}  // namespace taclink
