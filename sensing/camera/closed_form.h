#pragma once

#include <span>

#include "sensing/camera/bundle.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// Where a fit of one camera begins; on the link's axis, with the orientation of the model's nominal camera
/// but for a roll.
struct CameraStarts {
  /// The closed form of [duong2021, (4.37), (4.43)], solved by turns: focal length, place on the axis and the
  /// lens of the division model.
  CameraModel closed_form;
  CameraModel nominal;  ///< place and lens of the model
};

/// Both start from the point where the paths' lines meet, not from the mean of [duong2021, (4.35)], which is
/// off as soon as a marker is missing; no label needs to be right but the path's. The place is kept within
/// `place_tolerance_mm` of the nominal one.
CameraStarts FindStarts(const LinkModel& model, CameraId id, std::span<const BundleSample> samples,
                        double place_tolerance_mm);

}  // namespace taclink
