#include "sensing/pipeline/rest_pose.h"

#include <string>

#include "sensing/camera/rest_check.h"
#include "sensing/core/similar_skin.h"
#include "sensing/markers/rest_labels.h"
#include "sensing/pipeline/rest_match.h"

namespace taclink {
namespace {

constexpr double kLeastSeenFraction = 0.5;  // in each picture

}  // namespace

RestPose::RestPose(const LinkModel& model, const std::optional<StereoRig>& rig, int frames)
    : model_(model), rig_(rig), frames_(frames), mean_(model.markers.count()) {}

void RestPose::StartAgain() {
  tracker_.reset();
  mean_.Clear();
}

Result<bool> RestPose::Add(const std::array<Detections, kCameraCount>& detections,
                           const Eigen::VectorXd& inflation_mm) {
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
  mean_.Add(labels_);
  if (taken() < frames_) return false;
  return Finish(inflation_mm);
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

Result<bool> RestPose::Finish(const Eigen::VectorXd& inflation_mm) {
  mean_.Finish();
  noise_px_ = mean_.noise_px();
  if (mean_.moved()) {
    StartAgain();
    return Error{ErrorCode::kFailedPrecondition,
                 "the skin moved while its rest shape was taken; do not touch it"};
  }
  if (rig_) {
    const double limit_mm = CalibrationOptions{}.max_dent_mm * LengthUnit(model_);
    if (const auto dent = FindDent(model_, *rig_, mean_.markers(), inflation_mm, limit_mm)) {
      StartAgain();
      return Error{ErrorCode::kFailedPrecondition,
                   Describe(model_, *dent) + "; if nothing is there, a camera has moved: calibrate again"};
    }
    calibration_.emplace().rig = *rig_;
    return true;
  }
  auto calibrated = CalibrateFromRest(model_, mean_.markers());
  if (!calibrated) {
    StartAgain();
    return calibrated.error();
  }
  calibration_ = *calibrated;
  calibration_->pairs = taken();
  if (mean_.variances_px2().empty()) noise_px_ = calibrated->rms_px;
  return true;
}

}  // namespace taclink
