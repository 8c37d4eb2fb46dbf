#pragma once

#include <span>
#include <string>

#include "sensing/core/camera_model.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"

namespace taclink {

struct CalibrationOptions {
  double max_rms_px = 1.5;  ///< worse is refused
  double min_seen = 0.5;    ///< part of all markers that a picture must show
  /// How far a camera's place on the axis may be off the nominal one. One picture hardly tells place, focal
  /// length and lens apart where the lens model is not quite the lens; the mount is known better.
  double place_tolerance_mm = 5;
  double max_outliers = 0.1;  ///< part of the seen ones that may be left out
};

/// One camera, fitted to one picture.
struct CameraCalibration {
  CameraModel camera;
  int markers_used = 0;
  int outliers = 0;   ///< seen, but left out
  double rms_px = 0;  ///< of the reprojection, per axis, over the used ones
};

struct CalibrationSummary {
  StereoRig rig;
  int markers_used = 0;  ///< seen by both cameras
  double rms_px = 0;     ///< of the reprojection, per axis, both pictures
  double rmse_r_mm = 0;  ///< of the triangulated rest markers against the model
  double rmse_z_mm = 0;
  double rmse_3d_mm = 0;
};

/// Fits focal length, lens, principal point, roll and place on the axis to the labelled markers of a rest
/// picture. Start: the closed form, (4.37) and (4.43) by turns; the principal point is where the paths' lines
/// meet, not the mean of (4.35), which is off as soon as a marker is missing. Then Gauss-Newton on the
/// reprojection, all parameters together, with outliers left out. From the model's nominal rig, orientation
/// and picture size are kept. Errors: kInvalidArgument (too few markers, residual too large) with the reason.
Result<CameraCalibration> CalibrateCamera(const LinkModel& model, CameraId id,
                                          std::span<const MarkerObservation> rest,
                                          const CalibrationOptions& options = {});

/// Both cameras, from the labelled markers of a rest pair; checked by triangulating it. Errors as above.
Result<CalibrationSummary> CalibrateFromRest(const LinkModel& model, const LabelledMarkers& rest,
                                             const CalibrationOptions& options = {});

/// Calibration files (YAML, `taclink_calibration: 1`), for links of that model only. Errors: kNotFound,
/// kInvalidArgument (file, line, what was expected).
Result<StereoRig> LoadCalibration(const std::string& path, const LinkModel& model);
/// Replaces the file as a whole. Errors: kUnavailable.
Result<void> SaveCalibration(const std::string& path, const std::string& model_name,
                             const CalibrationSummary& summary);

}  // namespace taclink
