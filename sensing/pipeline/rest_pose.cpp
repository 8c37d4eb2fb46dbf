#include "sensing/pipeline/rest_pose.h"

#include <cmath>

#include "sensing/markers/rest_labels.h"

namespace taclink {

RestPose::RestPose(const LinkModel& model, const std::optional<StereoRig>& rig, int frames)
    : model_(model), rig_(rig), frames_(frames) {
  StartAgain();
}

void RestPose::StartAgain() {
  taken_ = 0;
  for (size_t c = 0; c < kCameraCount; ++c) {
    mean_.cameras[c].assign(static_cast<size_t>(model_.markers.count()), {});
    counts_[c].assign(static_cast<size_t>(model_.markers.count()), 0);
  }
}

Result<bool> RestPose::Add(const std::array<Detections, kCameraCount>& detections) {
  const auto labels = LabelRestPair(model_, detections);
  if (!labels) {
    StartAgain();
    return labels.error();
  }
  Accumulate(*labels);
  if (++taken_ < frames_) return false;
  return Finish();
}

void RestPose::Accumulate(const LabelledMarkers& labels) {
  for (size_t c = 0; c < kCameraCount; ++c) {
    for (size_t m = 0; m < labels.cameras[c].size(); ++m) {
      const MarkerObservation& one = labels.cameras[c][m];
      if (!one.seen) continue;
      mean_.cameras[c][m].center_px += one.center_px;
      mean_.cameras[c][m].sigma_px += one.sigma_px;
      ++counts_[c][m];
    }
  }
}

Result<bool> RestPose::Finish() {
  for (size_t c = 0; c < kCameraCount; ++c) {
    for (size_t m = 0; m < counts_[c].size(); ++m) {
      MarkerObservation& mean = mean_.cameras[c][m];
      const int n = counts_[c][m];
      mean.seen = 2 * n > taken_;
      if (!mean.seen) continue;
      mean.center_px /= n;
      mean.sigma_px /= n * std::sqrt(n);
    }
  }
  if (rig_) {
    calibration_ = CalibrationSummary{.rig = *rig_};
    return true;
  }
  auto calibrated = CalibrateFromRest(model_, mean_);
  if (!calibrated) {
    StartAgain();
    return calibrated.error();
  }
  calibration_ = *calibrated;
  return true;
}

}  // namespace taclink
