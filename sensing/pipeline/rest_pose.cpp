#include "sensing/pipeline/rest_pose.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "sensing/core/median.h"
#include "sensing/markers/rest_labels.h"
#include "sensing/pipeline/rest_match.h"

namespace taclink {
namespace {

constexpr double kLeastSeenFraction = 0.5;  // in each picture
// The skin moved if more than this part of the markers scatter by more than this; noise is a fraction of it.
constexpr double kMovedFraction = 0.03, kMovedPx = 1;

}  // namespace

RestPose::RestPose(const LinkModel& model, const std::optional<StereoRig>& rig, int frames)
    : model_(model), rig_(rig), frames_(frames) {
  StartAgain();
}

void RestPose::StartAgain() {
  taken_ = 0;
  tracker_.reset();
  const auto count = static_cast<size_t>(model_.markers.count());
  for (size_t c = 0; c < kCameraCount; ++c) {
    mean_.cameras[c].assign(count, {});
    squares_[c].assign(count, 0.0);
    counts_[c].assign(count, 0);
  }
}

Result<bool> RestPose::Add(const std::array<Detections, kCameraCount>& detections) {
  Result<void> good;
  if (!tracker_) {
    good = Begin(detections);
  } else {
    tracker_->Label(detections, labels_);
  }
  if (good) good = CheckCount();
  if (!good) {
    StartAgain();
    return good.error();
  }
  Accumulate();
  if (++taken_ < frames_) return false;
  return Finish();
}

// Labels the first pair, and makes the tracker that labels the others.
Result<void> RestPose::Begin(const std::array<Detections, kCameraCount>& detections) {
  if (rig_) {
    tracker_.emplace(model_, *rig_);
    tracker_->Label(detections, labels_);
    return {};
  }
  StereoRig found;
  std::array<RestMatch, kCameraCount> matches;
  for (const CameraId id : kBothCameras) {
    const auto labels = LabelRestPicture(model_, id, detections[Index(id)]);
    if (!labels) return labels.error();
    auto settled = SettleCamera(model_, id, *labels, detections[Index(id)], true);
    if (!settled) {
      return Error{ErrorCode::kInvalidArgument, std::string("no camera explains the ") + Name(id) +
                                                    " camera's rest picture; check the link model and that "
                                                    "nothing touches the skin"};
    }
    found[id] = settled->camera;
    labels_.cameras[Index(id)] = settled->match.markers;
    matches[Index(id)] = std::move(settled->match);
  }
  if (const std::string trouble = GridTrouble(model_, matches); !trouble.empty())
    return Error{ErrorCode::kInvalidArgument,
                 trouble + ": it is not this link's model, or something touches the skin"};
  tracker_.emplace(model_, found);
  return {};
}

Result<void> RestPose::CheckCount() const {
  for (const CameraId id : kBothCameras) {
    int seen = 0;
    for (const auto& marker : labels_.cameras[Index(id)]) seen += marker.seen ? 1 : 0;
    if (seen < kLeastSeenFraction * model_.markers.count()) {
      return Error{
          ErrorCode::kInvalidArgument,
          std::string(Name(id)) + " camera: only " + std::to_string(seen) + " of " +
              std::to_string(model_.markers.count()) +
              " markers recognised; check model, light and focus, and that nothing touches the skin"};
    }
  }
  return {};
}

void RestPose::Accumulate() {
  for (size_t c = 0; c < kCameraCount; ++c) {
    for (size_t m = 0; m < labels_.cameras[c].size(); ++m) {
      const MarkerObservation& one = labels_.cameras[c][m];
      if (!one.seen) continue;
      mean_.cameras[c][m].center_px += one.center_px;
      mean_.cameras[c][m].covariance_px2 += one.covariance_px2;
      squares_[c][m] += one.center_px.squaredNorm();
      ++counts_[c][m];
    }
  }
}

Result<bool> RestPose::Finish() {
  std::vector<double> variances;
  for (size_t c = 0; c < kCameraCount; ++c) {
    for (size_t m = 0; m < counts_[c].size(); ++m) {
      MarkerObservation& mean = mean_.cameras[c][m];
      const int n = counts_[c][m];
      mean.seen = 2 * n > taken_;
      if (!mean.seen) continue;
      mean.center_px /= n;
      mean.covariance_px2 /= n * n;
      if (n > 1) variances.push_back((squares_[c][m] - n * mean.center_px.squaredNorm()) / (2.0 * (n - 1)));
    }
  }
  noise_px_ = std::sqrt(std::max(0.0, Median(variances)));
  const auto moved = std::count_if(variances.begin(), variances.end(),
                                   [](double variance) { return variance > kMovedPx * kMovedPx; });
  if (static_cast<double>(moved) > kMovedFraction * static_cast<double>(variances.size())) {
    StartAgain();
    return Error{ErrorCode::kFailedPrecondition,
                 "the skin moved while its rest shape was taken; do not touch it"};
  }
  if (rig_) {
    calibration_.emplace().rig = *rig_;
    return true;
  }
  auto calibrated = CalibrateFromRest(model_, mean_);
  if (!calibrated) {
    StartAgain();
    return calibrated.error();
  }
  calibration_ = *calibrated;
  calibration_->pairs = taken_;
  if (variances.empty()) noise_px_ = calibrated->rms_px;
  return true;
}

}  // namespace taclink
