#pragma once

#include <string>

#include "sensing/core/camera_model.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"

namespace taclink {

struct CalibrationSummary {
  StereoRig rig;
  int markers_used = 0;  ///< seen by both cameras
  double rms_px = 0;     ///< of the reprojection
  double rmse_r_mm = 0;  ///< of the triangulated rest markers against the model
  double rmse_z_mm = 0;
  double rmse_3d_mm = 0;
};

/// Closed-form self-calibration from the labelled markers of a rest pair, (4.35) to (4.43), iterated. Start:
/// the model's nominal rig, from which orientation and picture size are kept. Errors: kInvalidArgument (too
/// few markers seen, residual too large) with the reason.
Result<CalibrationSummary> CalibrateFromRest(const LinkModel& model, const LabelledMarkers& rest);

/// Calibration files (YAML, `taclink_calibration: 1`).
Result<StereoRig> LoadCalibration(const std::string& path);
Result<void> SaveCalibration(const std::string& path, const std::string& model_name,
                             const CalibrationSummary& summary);

}  // namespace taclink
