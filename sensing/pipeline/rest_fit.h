#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "sensing/camera/calibration.h"
#include "sensing/core/known_loads.h"
#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"
#include "sensing/markers/label/path_tracker.h"
#include "sensing/pipeline/marker_mean.h"
#include "sensing/pipeline/rest_loads.h"
#include "sensing/pipeline/rest_match.h"
#include "sensing/pipeline/rest_touch.h"

namespace taclink {

using DetectionPair = std::array<Detections, kCameraCount>;

/// Images of the untouched skin, taken one after the other.
struct RestPairs {
  std::vector<DetectionPair> detections;
  std::array<cv::Mat, kCameraCount> first;  ///< the images of the first pair
};

/// What they show.
struct RestResult {
  CalibrationSummary calibration;  ///< of known cameras: these, and nothing else
  LabelledMarkers markers;         ///< the mean over the pairs
  /// How much a marker's place in an image scatters from frame to frame, each axis; with a single pair, what
  /// it is off the model's projection stands in.
  double noise_px = 0;
  MeasuredLoads loads;  ///< as the images show them
  /// With known cameras: their motion since the calibration.
  std::optional<Reason> moved_cameras = {};
};

/// Explains rest pairs: labels, cameras, mean markers and, where it is not known well, the specific force.
class RestFit {
 public:
  /// `rig`: the cameras, if known; none: they are calibrated, so. `pairs`: at least one; the caller keeps
  /// them.
  RestFit(const LinkModel& model, const std::optional<StereoRig>& rig, const CalibrationOptions& options,
          const RestPairs& pairs, RestSkin skin);

  /// `loads`: as measured. A specific force that is not known well is estimated, but of cameras that are not
  /// known the labels must be right at its mean. Takes a second or two. Errors: kInvalidArgument,
  /// kFailedPrecondition (too few markers, bad fit, skin touched or moving), with what to do.
  Result<RestResult> Explain(const MeasuredLoads& loads) const;

 private:
  struct FoundCameras {
    StereoRig rig;
    std::array<RestMatch, kCameraCount> matches;
    double score = 0;  // of SettledCamera, both cameras
  };
  std::optional<RestTouch> FindTouch(const Result<RestResult>& result, const MeasuredLoads& loads) const;
  std::string CameraTrouble(const Result<RestResult>& result, const MeasuredLoads& loads) const;
  Result<RestShape> ShapeAt(const MeasuredLoads& loads) const;
  Eigen::MatrixXd LoadErrorsMm(const RestShape& shape, const MeasuredLoads& loads) const;
  Result<FoundCameras> FindCameras(const RestShape& shape) const;
  Result<MarkerMean> Mean(const RestShape& shape, const StereoRig& rig, bool is_fitted) const;
  Result<RestResult> ExplainByRig(const StereoRig& rig, const MeasuredLoads& loads) const;
  Result<RestResult> Calibrate(const MeasuredLoads& loads) const;
  struct RoughCameras {
    StereoRig rig;
    LabelledMarkers labels;
  };
  Result<RoughCameras> CalibrateRoughly(const RestShape& shape) const;
  Result<RestResult> CalibrateAt(const RestShape& shape, const MeasuredLoads& loads,
                                 const CalibrationOptions& options) const;
  Result<RestResult> Refine(MeasuredLoads loads) const;

  const LinkModel& model_;
  const std::optional<StereoRig> rig_;
  const CalibrationOptions options_;
  const RestPairs& pairs_;
  const RestSkin skin_;
  DetectionPair steady_;  // of what stands still in the pairs
};

/// Why an image that shows so many markers, by camera, is no use; none: it is.
Result<void> CheckMarkerCount(const LinkModel& model, const std::array<int, kCameraCount>& seen);
Error SkinMoved();

}  // namespace taclink
