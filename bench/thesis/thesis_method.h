#pragma once

#include <memory>

#include "bench/vision/vision_method.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// Chapter 4 of the thesis as it is written: the picture less its undesired bright areas, a global threshold,
/// centroids of the bright regions; paths traced by (4.25) to (4.29) with lambda = 0.5 and alpha = beta =
/// 30 degrees, in both pictures from the near clamped end to the far one; cameras from (4.35) to (4.43);
/// positions from (4.11) to (4.15), from one camera by (4.31) and (4.32), from none by (4.33) and (4.34).
///
/// Where the thesis leaves something open it is decided in the method's favour: it begins with the model's
/// nominal cameras; the threshold is a part of the picture's own span of levels (so it follows the light),
/// chosen once, on the first rest picture, such that as many regions come out as markers should be seen; the
/// bright areas inside the far ring of markers and outside the near one are found in that picture too; a path
/// begins at the first ring that the nominal camera sees whole; calibration averages eight rest pictures and
/// leaves out labels that are nearer to another ring.
std::unique_ptr<VisionMethod> MakeThesisMethod(const LinkModel& model);

}  // namespace taclink
