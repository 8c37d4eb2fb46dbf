#include "sensing/capture/frame_pairer.h"

#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

/// Weight of a new frame interval in the running mean.
constexpr double kIntervalWeight = 0.125;
/// Beyond so many lost pictures of a camera its count is not believed.
constexpr uint32_t kMaxSequenceStep = 1u << 16;
/// Beyond so many lost pictures the time between two tells nothing about the rate.
constexpr uint32_t kMaxIntervalStep = 16;

}  // namespace

FramePairer::FramePairer(double frame_rate_hz) : nominal_interval_ns_(1e9 / frame_rate_hz) {
  for (Camera& camera : cameras_) camera.interval_ns = nominal_interval_ns_;
}

std::optional<FramePair> FramePairer::Add(CameraId id, const PictureTag& picture) {
  dropped_count_ = 0;
  Camera& camera = cameras_[Index(id)];
  if (camera.newest && picture.timestamp_ns <= camera.newest->timestamp_ns) {
    DropAll();
    Restart();
  }
  Follow(camera, picture);
  if (camera.waiting_count == kDepth) DropOldest(id);
  camera.waiting[camera.waiting_count++] = picture;

  const Camera& top = cameras_[Index(CameraId::kTop)];
  const Camera& bottom = cameras_[Index(CameraId::kBottom)];
  while (top.waiting_count > 0 && bottom.waiting_count > 0) {
    const int64_t bottom_minus_top = bottom.waiting[0].timestamp_ns - top.waiting[0].timestamp_ns;
    if (Match(bottom_minus_top)) return MakePair();
    // The older one has no partner: what comes later is further away still.
    DropOldest(bottom_minus_top > 0 ? CameraId::kTop : CameraId::kBottom);
  }
  return std::nullopt;
}

void FramePairer::Restart() {
  for (Camera& camera : cameras_) {
    camera.waiting_count = 0;
    camera.newest.reset();
    camera.interval_ns = nominal_interval_ns_;
  }
  restarted_ = true;
}

double FramePairer::frame_interval_ns() const {
  return std::min(cameras_[0].interval_ns, cameras_[1].interval_ns);
}

void FramePairer::Follow(Camera& camera, const PictureTag& picture) {
  if (camera.newest) {
    const uint32_t step = picture.sequence - camera.newest->sequence;
    const auto elapsed = static_cast<double>(picture.timestamp_ns - camera.newest->timestamp_ns);
    if (step >= 1 && step <= kMaxIntervalStep) {
      camera.interval_ns += kIntervalWeight * (elapsed / step - camera.interval_ns);
    }
  }
  camera.newest = picture;
}

void FramePairer::DropOldest(CameraId id) {
  Camera& camera = cameras_[Index(id)];
  dropped_[dropped_count_++] = {id, TakeOldest(camera)};
  ++camera.dropped_total;
}

void FramePairer::DropAll() {
  for (const CameraId id : kBothCameras) {
    while (cameras_[Index(id)].waiting_count > 0) DropOldest(id);
  }
}

PictureTag FramePairer::TakeOldest(Camera& camera) {
  const PictureTag oldest = camera.waiting[0];
  std::move(camera.waiting.begin() + 1, camera.waiting.end(), camera.waiting.begin());
  --camera.waiting_count;
  return oldest;
}

bool FramePairer::Match(int64_t bottom_minus_top_ns) const {
  bool same_way_round = false;
  if (last_pair_ && !restarted_) {
    const int64_t before =
        (*last_pair_)[CameraId::kBottom].timestamp_ns - (*last_pair_)[CameraId::kTop].timestamp_ns;
    same_way_round = (before < 0) == (bottom_minus_top_ns < 0);
  }
  const double limit_frames = 0.5 + (same_way_round ? kHysteresisFrames : 0);
  return static_cast<double>(std::abs(bottom_minus_top_ns)) <= limit_frames * frame_interval_ns();
}

FramePair FramePairer::MakePair() {
  FramePair pair;
  for (const CameraId id : kBothCameras) pair.pictures[Index(id)] = TakeOldest(cameras_[Index(id)]);
  if (last_pair_) {
    const PictureTag& top = pair[CameraId::kTop];
    const PictureTag& top_before = (*last_pair_)[CameraId::kTop];
    uint64_t step = top.sequence - top_before.sequence;  // in 32 bits: right across the wrap
    if (restarted_ || step < 1 || step > kMaxSequenceStep) {
      const auto elapsed = static_cast<double>(top.timestamp_ns - top_before.timestamp_ns);
      step = static_cast<uint64_t>(std::max(1.0, std::round(elapsed / nominal_interval_ns_)));
    }
    pair.sequence = last_pair_->sequence + step;
  }
  last_pair_ = pair;
  restarted_ = false;
  return pair;
}

}  // namespace taclink
