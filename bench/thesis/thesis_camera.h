#pragma once

#include <optional>
#include <span>
#include <vector>

#include "sensing/core/camera_model.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"

namespace taclink {

/// A camera as chapter 4 of the thesis models it: on the axis, looking along it, (4.3), (4.4), (4.41).
struct ThesisCamera {
  CameraId id = CameraId::kTop;
  double focal_px = 1;               ///< f
  double place_mm = 0;               ///< b: depth is b + Z for the top camera, b - Z for the bottom one
  Vec2 principal_px = Vec2::Zero();  ///< c
  double k1 = 0, k2 = 0;             ///< per px^2, px^4
  double turn_rad = 0;               ///< constant, subtracted from what it sees: the camera's roll
  Mat2 link_from_picture = Mat2::Identity();  ///< the picture's axes to X and Y; mirrors the bottom one

  struct Polar {
    double r = 0, phi = 0;  ///< without the lens' distortion
  };
  Polar See(const Vec2& pixel) const;
  double Depth(double z_mm) const { return id == CameraId::kTop ? place_mm + z_mm : place_mm - z_mm; }
  /// None: beyond what the distortion can be inverted for.
  std::optional<Vec2> Project(const Vec3& p_in_link) const;
};

/// The model's nominal camera.
ThesisCamera NominalThesisCamera(const LinkModel& model, CameraId id);

/// Self-calibration from a labelled rest picture, (4.35) to (4.43): principal point, then focal length and
/// place, and the lens, by turns, beginning without distortion. The round with the least error counts. None:
/// too few markers.
std::optional<ThesisCamera> CalibrateThesisCamera(const LinkModel& model, CameraId id,
                                                  std::span<const MarkerObservation> rest);

}  // namespace taclink
