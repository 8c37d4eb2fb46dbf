#pragma once

#include <optional>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"

namespace taclink {

/// Where the markers of an undeformed skin are in one picture, without a calibration: paths are lines through
/// one point, evenly spaced in angle, rings circles about it; both bent a little, as a camera that is not
/// quite on the axis bends them:
///   angle = path angle + roll + h_a(t, angle),  log radius = ring + h_r(t, angle),
/// h the first harmonic in the angle with coefficients quadratic in t, the log radius scaled to [-1, 1].
/// Rings are counted from the camera's end, paths as the model counts them.
class PictureGrid {
 public:
  /// Fits the grid to most of a picture's detections; a good part of the skin may be deformed, markers may be
  /// missing and false ones seen. Of the nominal rig only the orientation is believed (the roll to half a
  /// path pitch), the principal point to 64 px, and the lens to about 40 % of its scale.
  /// Errors: kInvalidArgument, with what does not fit.
  static Result<PictureGrid> Fit(const LinkModel& model, CameraId id, const Detections& detections);

  struct Place {
    int path = 0;           ///< nearest, from 0
    double off_path = 0;    ///< path pitches
    double log_radius = 0;  ///< as on an ideal ring
  };
  Place PlaceOf(const Vec2& pixel) const;
  Vec2 PixelOf(int path, double off_path, double log_radius) const;  ///< inverse of PlaceOf

  /// Falling, by ring from the camera's end.
  const std::vector<double>& ring_log_radii() const { return ring_log_radii_; }
  /// tan of the angle off the axis at which a ring's marker is seen, of a log radius: by the rings of the
  /// model, linear in the logs between them. The lens is in there.
  double TanAt(double log_radius) const;
  double LogRadiusAt(double tan_angle) const;
  /// Distance of a ring's markers from the camera along the axis, and their radius, mm.
  double ring_distance_mm(int ring_from_near) const {
    return distances_[static_cast<size_t>(ring_from_near)];
  }
  double ring_radius_mm(int ring_from_near) const { return radii_mm_[static_cast<size_t>(ring_from_near)]; }

  const Vec2& center_px() const { return center_; }
  double roll_rad() const { return roll_; }  ///< against the nominal rig
  /// Root mean square of the rings' log radii off the nominal lens' ones, scale aside.
  double lens_misfit() const { return lens_misfit_; }

 private:
  friend class GridFitter;
  using Harmonics = Eigen::Matrix<double, 6, 1>;  // cos, sin times 1, t, t^2
  PictureGrid(const LinkModel& model, CameraId id);
  double PathAngle(int path) const { return picture_angles_[static_cast<size_t>(path)] + roll_; }
  Harmonics HarmonicsAt(double angle, double log_radius) const;

  double path_pitch_ = 0;
  std::vector<double> picture_angles_;  // of the paths, nominal
  Vec2 center_ = Vec2::Zero();
  double roll_ = 0, lens_misfit_ = 0;
  std::vector<double> ring_log_radii_, log_tans_, distances_, radii_mm_;
  Harmonics angle_terms_ = Harmonics::Zero(), radius_terms_ = Harmonics::Zero();
};

}  // namespace taclink
