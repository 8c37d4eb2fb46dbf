#pragma once

#include <opencv2/core/mat.hpp>

#include "sensing/pipeline/picture_calibration.h"

namespace taclink::command {

/// The rest pictures side by side with every marker's residual as a magnified arrow, a scale and the numbers.
/// CV_8UC3.
cv::Mat ResidualPicture(const RestPictures& rest, const CalibrationSummary& summary);

}  // namespace taclink::command
