#pragma once

#include <optional>
#include <string>

#include "sensing/core/camera_model.h"

namespace taclink {

/// One parameter of a calibrated camera, as in table 4.1 of [duong2021].
struct CalibrationParameter {
  CameraId camera = CameraId::kTop;
  /// "position_x", "position_y", "position_z" (mm), "tilt_x", "tilt_y", "roll" (rad, against the model's
  /// nominal camera), "principal_point_x", "principal_point_y", "focal_length" (px), "lens_k1" ... "lens_k4".
  std::string name;
  std::string unit;  ///< "mm", "rad", "px", "px^-2", "px^-4", "1"
  double value = 0;
  double sigma = 0;  ///< standard deviation from the fit; 0: unknown
  /// Mean and standard deviation (n - 1) over repeated calibrations. None: fewer than two.
  std::optional<double> mean = {}, scatter = {};
};

/// Displacement of a camera in the link frame, and its rotation, each with its standard deviation.
struct CameraShift {
  double moved_mm = 0, moved_sigma_mm = 0;
  double turned_rad = 0, turned_sigma_rad = 0;
};

}  // namespace taclink
