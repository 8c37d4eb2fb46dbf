#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <vector>

#include "sensing/camera/calibration.h"
#include "sensing/core/known_loads.h"
#include "sensing/core/link_model.h"
#include "sensing/core/markers.h"
#include "sensing/core/result.h"
#include "sensing/pipeline/rest_fit.h"

namespace taclink {

/// Collects rest pairs until the cameras, the mean rest markers and the noise of their positions are known.
/// What takes long, labels and cameras, is looked for once all pairs are there: spots that stay where they
/// are tell in no time that the skin rests, while on a busy machine a skin would have moved on meanwhile.
class RestPose {
 public:
  /// `rig`: the cameras, if known; none: they are calibrated from the rest pairs.
  RestPose(const LinkModel& model, const std::optional<StereoRig>& rig, int frames,
           const CalibrationOptions& calibration = {});

  /// True: complete. False: needs more pairs. Error: the pairs are no use (the skin moved, too few markers,
  /// bad fit), with the reason; collecting starts again: with this pair where it is the one that shows the
  /// motion. `images`: that the detections are of. `loads`: under which the pairs may have been taken, at
  /// least one; the first that explain them count.
  Result<bool> Add(const DetectionPair& detections, const std::array<cv::Mat, kCameraCount>& images,
                   std::span<const MeasuredLoads> loads, const RestSkin& skin);

  /// Forgets the pairs so far.
  void StartAgain();

  /// Pairs so far.
  int taken() const { return static_cast<int>(pairs_.detections.size()); }
  /// Set once complete.
  const std::optional<RestResult>& result() const { return result_; }

 private:
  bool HasMoved(const DetectionPair& pair) const;

  const LinkModel model_;
  const std::optional<StereoRig> rig_;
  const int frames_;  // pairs
  const CalibrationOptions options_;

  RestPairs pairs_;
  std::optional<RestResult> result_;
};

}  // namespace taclink
