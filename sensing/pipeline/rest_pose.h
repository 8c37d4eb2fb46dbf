#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "sensing/camera/calibration.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"
#include "sensing/markers/label/path_tracker.h"
#include "sensing/pipeline/marker_mean.h"

namespace taclink {

/// Collects rest pairs until the cameras, the mean rest markers and the noise of their positions are known.
/// What takes long, labels and cameras, is looked for once all pairs are there: spots that stay where they
/// are tell in no time that the skin rests, while on a busy machine a skin would have moved on meanwhile.
class RestPose {
 public:
  /// `rig`: the cameras, if known; none: they are calibrated from the rest pairs.
  RestPose(const LinkModel& model, const std::optional<StereoRig>& rig, int frames);

  /// True: complete. False: needs more pairs. Error: the pairs are no use (the skin moved, too few markers,
  /// bad fit), with the reason; collecting starts again: with this pair where it is the one that shows the
  /// motion. `pictures`: that the detections are of. `inflation_mm`: what pressure moves the markers by,
  /// stacked.
  Result<bool> Add(const std::array<Detections, kCameraCount>& detections,
                   const std::array<cv::Mat, kCameraCount>& pictures, const Eigen::VectorXd& inflation_mm);

  /// Forgets the pairs so far.
  void StartAgain();

  /// Pairs so far.
  int taken() const { return static_cast<int>(pairs_.size()); }
  /// Set once complete.
  const std::optional<CalibrationSummary>& calibration() const { return calibration_; }
  /// The mean over the pairs. Valid once complete.
  const LabelledMarkers& markers() const { return mean_.markers(); }
  /// How much a marker's place in a picture scatters from frame to frame, each axis; with a single pair, what
  /// it is off the model's projection stands in. Valid once complete.
  double noise_px() const { return noise_px_; }

 private:
  using Pair = std::array<Detections, kCameraCount>;
  bool HasMoved(const Pair& pair) const;
  Result<void> Label();
  Pair Steady() const;
  Result<void> FindCameras();
  Result<void> CheckCount(const std::array<int, kCameraCount>& seen) const;
  Result<bool> Finish(const Eigen::VectorXd& inflation_mm);

  const LinkModel model_;
  const std::optional<StereoRig> rig_;
  const int frames_;  // pairs

  std::vector<Pair> pairs_;
  std::array<cv::Mat, kCameraCount> first_pictures_;  // of the first pair
  // Once all pairs are there.
  std::optional<PathTracker> tracker_;
  LabelledMarkers labels_;  // of the pair in work
  MarkerMean mean_;
  std::optional<CalibrationSummary> calibration_;
  double noise_px_ = 0;
};

}  // namespace taclink
