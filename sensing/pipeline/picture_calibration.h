#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <span>

#include "sensing/camera/calibration.h"
#include "sensing/core/link_model.h"
#include "sensing/core/result.h"
#include "sensing/pipeline/rest_fit.h"

namespace taclink {

/// By camera; CV_8UC1, of the size that the model's nominal camera has.
using RestPictures = std::array<cv::Mat, kCameraCount>;

/// Under which rest images are taken, and what the skin does there.
struct RestConditions {
  MeasuredLoads loads;
  RestSkin skin;
};

/// Calibrates both cameras from pictures of the untouched skin: finds and labels the markers of each pair,
/// averages the pairs, fits, and judges the result. `options.progress` is told on the way. Takes as long as
/// RestFit::Explain. Errors, all with what to do: kInvalidArgument (wrong size, too few markers, wrong model,
/// skin touched or moving between the pairs, top and bottom picture swapped). Where the two cameras are
/// nominally alike and the grid is its own mirror image, swapped pictures can't be told from right ones.
Result<RestResult> CalibrateFromPictures(const LinkModel& model, std::span<const RestPictures> pairs,
                                         const RestConditions& rest, const CalibrationOptions& options = {});
/// Of a skin without pressure and weight.
Result<CalibrationSummary> CalibrateFromPictures(const LinkModel& model, std::span<const RestPictures> pairs,
                                                 const CalibrationOptions& options = {});

/// One camera from one picture; only its own errors can be found.
Result<CameraCalibration> CalibrateFromPicture(const LinkModel& model, CameraId id, const cv::Mat& picture,
                                               const CalibrationOptions& options = {});

}  // namespace taclink
