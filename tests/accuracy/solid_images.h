#pragma once

#include "tests/accuracy/accuracy_row.h"

namespace taclink {

/// The whole way from images to forces: images of a solid's markers, by cameras that sit elsewhere than the
/// model says and blur more than the renderer's default.
AccuracyRow SolveSolidImages(const SolidScene& scene);

}  // namespace taclink
