#include "sensing/pipeline/rest_pose.h"

#include <algorithm>
#include <utility>

namespace taclink {
namespace {

// Spots stand still but for noise; what moves faster than that from pair to pair, MarkerMean sees.
constexpr double kStillSpotPx = 1.5, kBesidePx = 8, kMovedSpots = 0.1;

}  // namespace

RestPose::RestPose(const LinkModel& model, const std::optional<StereoRig>& rig, int frames,
                   const CalibrationOptions& calibration)
    : model_(model), rig_(rig), frames_(frames), options_(calibration) {}

void RestPose::StartAgain() {
  pairs_.detections.clear();
  result_.reset();
}

Result<bool> RestPose::Add(const DetectionPair& detections, const std::array<cv::Mat, kCameraCount>& images,
                           std::span<const MeasuredLoads> loads, const RestSkin& skin) {
  if (const auto enough = CheckMarkerCount(
          model_, {static_cast<int>(detections[0].size()), static_cast<int>(detections[1].size())});
      !enough) {
    StartAgain();
    return enough.error();
  }
  const bool has_moved = taken() > 0 && HasMoved(detections);
  if (has_moved) StartAgain();
  if (taken() == 0) {
    for (const CameraId id : kBothCameras) pairs_.first[Index(id)] = images[Index(id)].clone();
  }
  pairs_.detections.push_back(detections);
  if (has_moved) return SkinMoved();
  if (taken() < frames_) return false;
  const RestFit fit(model_, rig_, options_, pairs_, skin);
  std::optional<Error> refusal;
  for (const MeasuredLoads& one : loads) {
    auto result = fit.Explain(one);
    if (result) {
      result_ = *std::move(result);
      return true;
    }
    if (!refusal) refusal = result.error();
  }
  StartAgain();
  return *std::move(refusal);
}

// Whether many spots of the first pair are beside where they were now. Those that just come and go have not
// moved.
bool RestPose::HasMoved(const DetectionPair& pair) const {
  const auto is_at = [](const Detections& spots, const Vec2& place_px) {
    return std::any_of(spots.begin(), spots.end(), [&](const Detection& spot) {
      return (spot.center_px - place_px).squaredNorm() < kStillSpotPx * kStillSpotPx;
    });
  };
  for (const CameraId id : kBothCameras) {
    const Detections &before = pairs_.detections.front()[Index(id)], &now = pair[Index(id)];
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

}  // namespace taclink
