#pragma once

#include <array>
#include <optional>
#include <vector>

#include "sensing/camera/calibration.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"
#include "sensing/markers/path_tracker.h"
#include "sensing/pipeline/marker_mean.h"

namespace taclink {

/// Collects rest pairs until the cameras, the mean rest markers and the noise of their positions are known.
class RestPose {
 public:
  /// `rig`: the cameras, if known; none: they are calibrated from the rest pairs.
  RestPose(const LinkModel& model, const std::optional<StereoRig>& rig, int frames);

  /// True: complete. False: needs more pairs. Error: this pair is no use (too few markers, bad fit), with the
  /// reason; collecting starts again. `inflation_mm`: what pressure moves the markers by, stacked.
  Result<bool> Add(const std::array<Detections, kCameraCount>& detections,
                   const Eigen::VectorXd& inflation_mm);

  /// Forgets the pairs so far.
  void StartAgain();

  /// Pairs so far.
  int taken() const { return mean_.frames(); }
  /// Set once complete.
  const std::optional<CalibrationSummary>& calibration() const { return calibration_; }
  /// The mean over the pairs. Valid once complete.
  const LabelledMarkers& markers() const { return mean_.markers(); }
  /// How much a marker's place in a picture scatters from frame to frame, each axis; with a single pair, the
  /// calibration's residual stands in. Valid once complete.
  double noise_px() const { return noise_px_; }

 private:
  Result<void> Begin(const std::array<Detections, kCameraCount>& detections);
  Result<void> CheckCount() const;
  Result<bool> Finish(const Eigen::VectorXd& inflation_mm);

  const LinkModel model_;
  const std::optional<StereoRig> rig_;
  const int frames_;

  std::optional<PathTracker> tracker_;  // from the first pair on
  LabelledMarkers labels_;              // of the newest pair
  MarkerMean mean_;
  std::optional<CalibrationSummary> calibration_;
  double noise_px_ = 0;
};

}  // namespace taclink
