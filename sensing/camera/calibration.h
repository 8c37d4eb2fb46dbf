#pragma once

#include <array>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sensing/camera/bundle.h"
#include "sensing/camera/projection.h"
#include "sensing/camera/rest_shape.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"

namespace taclink {

/// Told between the steps of a calibration, from its own thread.
struct CalibrationProgress {
  double done = 0;   ///< of 1
  std::string step;  ///< what begins now
};

struct CalibrationOptions {
  std::optional<LensKind> lens = std::nullopt;  ///< to fit; none: the model's
  BuildTolerance tolerance = {};                ///< priors of the fit
  /// A camera further than so many tolerances off the model's nominal one is refused: the model is a wrong
  /// one, or its cameras must be corrected.
  double max_departure = 3;
  double max_rms_px = 1.5;    ///< worse is refused
  double min_seen = 0.5;      ///< part of all markers that a picture must show
  double max_outliers = 0.1;  ///< part of the seen ones that may be left out
  double max_dent_mm = 0.4;   ///< a patch that lies further in than the model says is called touched
  /// Markers are half balls that show another side to every camera; false: points, for made-up pictures.
  bool domes = true;
  std::function<void(const CalibrationProgress&)> progress = nullptr;
};

/// What became of one marker in one picture.
struct MarkerResidual {
  enum class Kind { kUnseen, kOutlier, kUsed };
  Kind kind = Kind::kUnseen;
  Vec2 seen_px = Vec2::Zero();
  Vec2 residual_px = Vec2::Zero();  ///< seen less projected from where the model has it
};

/// One camera, fitted to one picture.
struct CameraCalibration {
  CameraModel camera;
  CameraStep sigmas = CameraStep::Zero();  ///< standard deviations of its parameters (see CameraStep)
  int markers_used = 0;
  int outliers = 0;                       ///< seen, but left out
  double rms_px = 0;                      ///< of the reprojection, per axis, over the used ones
  std::vector<MarkerResidual> residuals;  ///< by marker
};

struct CalibrationSummary {
  StereoRig rig;
  int markers_used = 0;  ///< by both cameras
  double rms_px = 0;     ///< of the reprojection, per axis, both pictures
  /// Of the triangulated rest markers against the model: distance from the axis, angle times that distance,
  /// along the axis.
  double rmse_r_mm = 0;
  double rmse_phi_r_mm = 0;
  double rmse_z_mm = 0;
  double rmse_3d_mm = 0;
  std::array<CameraCalibration, kCameraCount> cameras = {};
  /// 26 x 26, of the top camera's CameraStep and then the bottom one's; empty: can't be told.
  Eigen::MatrixXd covariance;
  /// Shares of the rest shape's errors that the images show, and their covariance.
  Eigen::VectorXd error_shares;
  Eigen::MatrixXd error_covariance;
  /// Triangulated less the model's, by marker; none: not used by both cameras.
  std::vector<std::optional<Vec3>> shifts_mm;
  int pairs = 1;  ///< of rest pictures, averaged
  /// Half the squared distance of the cameras from the model's nominal ones, in tolerances.
  double departure_cost = 0;
};

/// Fits pose, principal point and lens of one camera to the labelled markers of a rest picture. Start: the
/// closed form of the thesis (see FindStarts); then a robust adjustment of all parameters. Picture size is
/// the nominal one's. Errors: kInvalidArgument (too few markers, residual too large, far off the model) with
/// the reason.
Result<CameraCalibration> CalibrateCamera(const RestShape& shape, CameraId id,
                                          std::span<const MarkerObservation> rest,
                                          const CalibrationOptions& options = {});

/// Both cameras, from the labelled markers of a rest pair: each alone first, then both and the markers'
/// places within the mould's tolerance in one bundle adjustment. Errors as above, and a skin that is touched.
Result<CalibrationSummary> CalibrateFromRest(const RestShape& shape, const LabelledMarkers& rest,
                                             const CalibrationOptions& options = {});

}  // namespace taclink
