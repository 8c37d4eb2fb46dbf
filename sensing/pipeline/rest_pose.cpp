#include "sensing/pipeline/rest_pose.h"

#include <algorithm>
#include <string>

#include "sensing/camera/rest_check.h"
#include "sensing/core/similar_skin.h"
#include "sensing/markers/label/rest_labels.h"
#include "sensing/pipeline/rest_match.h"

namespace taclink {
namespace {

constexpr double kLeastSeenFraction = 0.5;  // in each picture
// Spots stand still but for noise; what moves faster than that from pair to pair, MarkerMean sees.
constexpr double kStillPx = 1.5, kBesidePx = 8, kMovedSpots = 0.1;

Error Moved() {
  return {ErrorCode::kFailedPrecondition, "the skin moved while its rest shape was taken; do not touch it"};
}

}  // namespace

RestPose::RestPose(const LinkModel& model, const std::optional<StereoRig>& rig, int frames)
    : model_(model), rig_(rig), frames_(frames), mean_(model.markers.count()) {}

void RestPose::StartAgain() {
  pairs_.clear();
  tracker_.reset();
  mean_.Clear();
}

Result<bool> RestPose::Add(const std::array<Detections, kCameraCount>& detections,
                           const std::array<cv::Mat, kCameraCount>& pictures,
                           const Eigen::VectorXd& inflation_mm) {
  if (const auto enough =
          CheckCount({static_cast<int>(detections[0].size()), static_cast<int>(detections[1].size())});
      !enough) {
    StartAgain();
    return enough.error();
  }
  const bool has_moved = !pairs_.empty() && HasMoved(detections);
  if (has_moved) StartAgain();
  if (pairs_.empty()) {
    for (const CameraId id : kBothCameras) first_pictures_[Index(id)] = pictures[Index(id)].clone();
  }
  pairs_.push_back(detections);
  if (has_moved) return Moved();
  if (taken() < frames_) return false;
  if (const auto good = Label(); !good) {
    StartAgain();
    return good.error();
  }
  return Finish(inflation_mm);
}

// Whether many spots of the first pair are beside where they were now. Those that just come and go have not
// moved.
bool RestPose::HasMoved(const Pair& pair) const {
  const auto is_at = [](const Detections& spots, const Vec2& place_px) {
    return std::any_of(spots.begin(), spots.end(), [&](const Detection& spot) {
      return (spot.center_px - place_px).squaredNorm() < kStillPx * kStillPx;
    });
  };
  for (const CameraId id : kBothCameras) {
    const Detections &before = pairs_.front()[Index(id)], &now = pair[Index(id)];
    std::vector<Vec2> new_px;
    for (const Detection& spot : now) {
      if (!is_at(before, spot.center_px)) new_px.push_back(spot.center_px);
    }
    const auto moved = std::count_if(before.begin(), before.end(), [&](const Detection& spot) {
      return !is_at(now, spot.center_px) && std::any_of(new_px.begin(), new_px.end(), [&](const Vec2& px) {
        return (px - spot.center_px).squaredNorm() < kBesidePx * kBesidePx;
      });
    });
    if (static_cast<double>(moved) > kMovedSpots * static_cast<double>(before.size())) return true;
  }
  return false;
}

// The mean places of the spots that most pairs show.
RestPose::Pair RestPose::Steady() const {
  struct Spot {
    Detection first;
    Vec2 sum_px;
    int count;
    Vec2 mean_px() const { return sum_px / count; }
  };
  Pair steady;
  for (size_t c = 0; c < kCameraCount; ++c) {
    std::vector<Spot> spots;
    for (const Pair& pair : pairs_) {
      for (const Detection& seen : pair[c]) {
        const auto known = std::find_if(spots.begin(), spots.end(), [&](const Spot& spot) {
          return (spot.mean_px() - seen.center_px).squaredNorm() < kStillPx * kStillPx;
        });
        if (known == spots.end()) {
          spots.push_back({seen, seen.center_px, 1});
        } else {
          known->sum_px += seen.center_px;
          ++known->count;
        }
      }
    }
    for (const Spot& spot : spots) {
      if (2 * spot.count <= taken()) continue;
      steady[c].push_back(spot.first);
      steady[c].back().center_px = spot.mean_px();
    }
  }
  return steady;
}

Result<void> RestPose::Label() {
  if (const auto found = FindCameras(); !found) return found.error();
  for (const Pair& pair : pairs_) {
    // Of a single pair, spots that were found by looking again are among its labels.
    if (rig_ || frames_ > 1) tracker_->Label(pair, labels_);
    std::array<int, kCameraCount> seen{};
    for (size_t c = 0; c < kCameraCount; ++c)
      seen[c] = static_cast<int>(std::count_if(labels_.cameras[c].begin(), labels_.cameras[c].end(),
                                               [](const MarkerObservation& one) { return one.seen; }));
    if (const auto enough = CheckCount(seen); !enough) return enough.error();
    mean_.Add(labels_);
  }
  return {};
}

// Makes the tracker that labels the pairs, where the cameras are not known from what stands still in them.
Result<void> RestPose::FindCameras() {
  if (rig_) {
    tracker_.emplace(model_, *rig_);
    return {};
  }
  Pair detections = Steady();
  StereoRig found;
  std::array<RestMatch, kCameraCount> matches;
  for (const CameraId id : kBothCameras) {
    const auto labels = LabelRestPicture(model_, id, detections[Index(id)], first_pictures_[Index(id)]);
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

Result<void> RestPose::CheckCount(const std::array<int, kCameraCount>& seen) const {
  for (const CameraId id : kBothCameras) {
    if (seen[Index(id)] < kLeastSeenFraction * model_.markers.count()) {
      return Error{
          ErrorCode::kInvalidArgument,
          std::string(Name(id)) + " camera: only " + std::to_string(seen[Index(id)]) + " of " +
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
    return Moved();
  }
  if (rig_) {
    const double limit_mm = CalibrationOptions{}.max_dent_mm * LengthUnit(model_);
    const CalibrationSummary seen = ResidualsOf(model_, *rig_, mean_.markers(), inflation_mm);
    if (const auto dent = FindDent(model_, seen, limit_mm)) {
      StartAgain();
      return Error{ErrorCode::kFailedPrecondition,
                   Describe(model_, *dent) + "; if nothing is there, a camera has moved: calibrate again"};
    }
    calibration_.emplace().rig = *rig_;
    if (mean_.variances_px2().empty()) noise_px_ = seen.rms_px;
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
