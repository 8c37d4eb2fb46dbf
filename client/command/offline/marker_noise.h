#pragma once

#include "sensing/core/link_model.h"
#include "sensing/core/skin_shape.h"

namespace taclink::command {

/// Standard deviations of markers' displacements, mm.
struct MarkerNoise {
  double xy_mm = 0.05;
  double z_mm = 0.15;
};

/// What the displacements of markers that were seen tell about their own noise; never less than MarkerNoise's
/// defaults, which also hold where markers are too far apart, or too few are seen, to tell noise from a dent.
///
/// Of the sixth differences of neighbors around each ring: the skin hardly bends from marker to marker (it
/// decays over sqrt(R t)), noise does. The median of their sizes leaves out the few at a sharp edge or at an
/// outlier.
MarkerNoise NoiseOf(const LinkModel& model, const SkinShape& shape);

}  // namespace taclink::command
