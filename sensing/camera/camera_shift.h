#pragma once

#include <optional>
#include <span>

#include "sensing/core/calibration_report.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// A point and its pixel in the camera's current image.
struct PointImage {
  Vec3 at_mm = Vec3::Zero();  ///< link frame
  Vec2 pixel = Vec2::Zero();
};

/// Displacement of a camera from its calibrated pose, `camera`, with the same lens: the rigid motion that
/// best explains `images`. Gauss-Newton with Huber weights, iteratively reweighted [huber1981]. Errors of the
/// mould were present at the calibration and hardly affect the result. None: too few points, or no
/// convergence.
std::optional<CameraShift> FindCameraShift(const CameraModel& camera, std::span<const PointImage> images);

/// Displacement from which a shift is large, mm.
double LargeShiftMm(const LinkModel& model);
/// Whether the shift is significant and makes forces doubtful: beyond 0.25 mm or 0.09 degrees, lengths scaled
/// to the skin, and beyond 4 standard deviations.
bool IsLarge(const CameraShift& shift, const LinkModel& model);

}  // namespace taclink
