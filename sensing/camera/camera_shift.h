#pragma once

#include <optional>
#include <span>

#include "sensing/core/calibration_report.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// A point and its pixel in the camera's image as it is now.
struct PointImage {
  Vec3 at_mm = Vec3::Zero();  ///< link frame
  Vec2 pixel = Vec2::Zero();
};

/// How far a camera lies off `camera`, a calibrated one with the same lens: the rigid motion that explains
/// `images` best. Gauss-Newton on a robust sum (Huber's, iteratively reweighted [huber1981]). What a mould's
/// errors do to the pixels was there when the camera was calibrated, and hardly moves it. None: too few
/// points, or no motion converges.
std::optional<CameraShift> FindCameraShift(const CameraModel& camera, std::span<const PointImage> images);

/// From where on a shift is large, mm.
double LargeShiftMm(const LinkModel& model);
/// Whether the shift is real and puts forces in doubt: beyond 0.25 mm or 0.09 degrees, lengths scaled to the
/// skin, and beyond 4 standard deviations.
bool IsLarge(const CameraShift& shift, const LinkModel& model);

}  // namespace taclink
