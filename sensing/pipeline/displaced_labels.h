#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "sensing/camera/rest_shape.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"

namespace taclink {

/// As LabelRestPicture, of a skin that is displaced at rest by pressure or weight. The labels are those of
/// the spots moved back by what the displacement does to the image of the nominal camera, which is smooth:
/// places and roll of the camera need to be known no better than for an undeformed skin. With a displacement
/// that shows, `gray` is not looked at again.
Result<std::vector<MarkerObservation>> LabelDisplacedRest(const RestShape& shape, CameraId id,
                                                          Detections& detections, const cv::Mat& gray = {});

}  // namespace taclink
