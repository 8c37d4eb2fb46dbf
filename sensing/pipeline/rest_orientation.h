#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <string>

#include "sensing/camera/rest_shape.h"
#include "sensing/core/frame.h"
#include "sensing/core/markers.h"

namespace taclink {

/// Half the squared distance of the cameras from the nominal ones, in tolerances, below which no other
/// orientation is better by OrientationTrouble's margin.
inline constexpr double kLeastDeparture = 3;

/// Whether rest images fit the model's nominal cameras, and clearly better than as given, when they are
/// exchanged, or when one of them is mirrored or turned by half a turn: then they are. A marker grid looks
/// alike either way; what tells is where the lens' principal point is, as long as the cameras are nearer to
/// their nominal ones than the two alternatives are to each other. A camera whose principal point is in the
/// middle of its image tells nothing. `images`: CV_8UC1, those of `spots`. Takes some tenths of a second.
/// Empty: they are as they should be, or it cannot be told.
std::string OrientationTrouble(const RestShape& shape, const std::array<Detections, kCameraCount>& spots,
                               const std::array<cv::Mat, kCameraCount>& images, bool domes);

}  // namespace taclink
