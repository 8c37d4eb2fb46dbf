#pragma once

#include <array>
#include <optional>
#include <vector>

#include "sensing/camera/calibration.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"

namespace taclink {

/// Collects rest pairs until cameras and baseline are known.
class RestPose {
 public:
  /// `rig`: the cameras, if known; none: they are calibrated from the rest pairs.
  RestPose(const LinkModel& model, const std::optional<StereoRig>& rig, int frames);

  /// True: complete. False: needs more pairs. Error: this pair is no use (too few markers, bad fit), with the
  /// reason; collecting starts again.
  Result<bool> Add(const std::array<Detections, kCameraCount>& detections);

  /// Set once complete.
  const std::optional<CalibrationSummary>& calibration() const { return calibration_; }
  /// The mean over the pairs. Valid once complete.
  const LabelledMarkers& markers() const { return mean_; }

 private:
  void Accumulate(const LabelledMarkers& labels);
  Result<bool> Finish();
  void StartAgain();

  LinkModel model_;
  std::optional<StereoRig> rig_;
  int frames_;

  int taken_ = 0;
  LabelledMarkers mean_;                               // sums until complete
  std::array<std::vector<int>, kCameraCount> counts_;  // how often each marker was seen
  std::optional<CalibrationSummary> calibration_;
};

}  // namespace taclink
