#include "sensing/pipeline/camera_diagnosis.h"

#include <algorithm>

#include "sensing/pipeline/image_displacement.h"

namespace taclink {
namespace {

constexpr int64_t kPauseNs = 500'000'000;
constexpr int kLeastFrames = 3;  // a single bad image has no cause that lasts
constexpr int kMostSpots = 3;    // for each marker; more are clutter, and take long

}  // namespace

void CameraDiagnosis::Restart() {
  reason_.reset();
  suspect_frames_ = 0;
  next_ns_ = 0;
}

void CameraDiagnosis::Observe(const LinkState& state, const std::array<cv::Mat, kCameraCount>& images,
                              const StereoRig& rig, std::span<const Vec3> skin_mm) {
  // Its own reason confirms nothing.
  const auto may_come = [&](const Reason& reason) {
    return TraitsOf(reason.id).may_come_of_cameras && !(reason_ && reason.text == reason_->text);
  };
  suspect_frames_ = std::ranges::any_of(state.reasons, may_come) ? suspect_frames_ + 1 : 0;
  // A reason stands until a later look does not find it.
  if (suspect_frames_ < kLeastFrames && !reason_) return;
  const int64_t now_ns = state.times.exposure_monotonic_ns;
  if (now_ns < next_ns_ && now_ns >= next_ns_ - kPauseNs) return;
  next_ns_ = now_ns + kPauseNs;
  for (size_t i = 0; i < kCameraCount; ++i) {
    spots_[i].clear();
    if (!images[i].empty()) detector_.Detect(images[i], spots_[i]);
    if (static_cast<int>(spots_[i].size()) > kMostSpots * model_.markers.count()) spots_[i].clear();
  }
  reason_ = DiagnoseImages(model_, rig, skin_mm, spots_);
}

}  // namespace taclink
