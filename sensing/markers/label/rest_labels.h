#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"

namespace taclink {

/// Labels a rest picture before the cameras are calibrated. Of the model's nominal rig only the orientation
/// is believed, the roll to half a path pitch, see PictureGrid. With `gray` LabelPicture looks again, and
/// what it finds is added to `detections`: blur merges spots of the far rings that are markers each. Errors:
/// kInvalidArgument, with what does not fit. For calibration, not for every frame: it allocates.
Result<std::vector<MarkerObservation>> LabelRestPicture(const LinkModel& model, CameraId id,
                                                        Detections& detections, const cv::Mat& gray = {});

}  // namespace taclink
