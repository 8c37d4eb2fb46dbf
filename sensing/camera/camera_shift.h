#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "sensing/core/calibration_report.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// A point and its pixel in the camera's current image.
struct PointImage {
  Vec3 at_mm = Vec3::Zero();  ///< link frame
  Vec2 pixel = Vec2::Zero();
  /// Displacements of the point by one standard deviation of each common error of the shape (pressure,
  /// weight): the same number for all points, mm.
  std::vector<Vec3> errors_mm = {};
};

/// Displacements of the cameras of a rig, each from its calibrated pose and with the same lens: the rigid
/// motions and the common errors of the shape, with a standard normal prior, that best explain `images` (by
/// camera). Gauss-Newton with Huber weights, iteratively reweighted [huber1981]. None: too few points, or no
/// convergence.
std::optional<std::array<CameraShift, kCameraCount>> FindCameraShifts(
    const StereoRig& rig, const std::array<std::vector<PointImage>, kCameraCount>& images);

/// One camera, where the points are exact. Errors of the mould were present at the calibration and hardly
/// affect the result. None: likewise.
std::optional<CameraShift> FindCameraShift(const CameraModel& camera, std::span<const PointImage> images);

/// Displacement from which a shift is large, mm.
double LargeShiftMm(const LinkModel& model);
/// Whether the shift is significant and makes forces doubtful: beyond 0.25 mm or 0.09 degrees, lengths scaled
/// to the skin, and beyond 4 standard deviations.
bool IsLarge(const CameraShift& shift, const LinkModel& model);

}  // namespace taclink
