#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "sensing/camera/projection.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/link_model.h"
#include "sensing/simulation/scene.h"

namespace taclink {

/// What a camera sees besides the markers: dark skin between the rim at its own end and the LED ring of the
/// other one, which glows. Never changes.
struct Background {
  cv::Mat gray;    ///< CV_8UC1
  cv::Mat chroma;  ///< CV_8UC1, as large: U in even columns, V in odd ones, as YUYV has them
};

Background MakeBackground(const LinkModel& model, const CameraModel& camera, CameraId id,
                          const CameraEffects& effects, uint64_t seed);

}  // namespace taclink
