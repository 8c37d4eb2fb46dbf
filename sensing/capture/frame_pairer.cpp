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
    for (const CameraId each : kBothCameras) {
      DropAll(each);
      Forget(cameras_[Index(each)]);
    }
  }
  camera.lost = false;
  Follow(camera, picture);
  const CameraId other = id == CameraId::kTop ? CameraId::kBottom : CameraId::kTop;
  if (cameras_[Index(other)].lost) DropAll(id);
  if (camera.waiting_count == kDepth) DropOldest(id);
  camera.waiting[camera.waiting_count++] = picture;
  if (cameras_[Index(other)].lost) return MakeAlone(id);

  const Camera& top = cameras_[Index(CameraId::kTop)];
  const Camera& bottom = cameras_[Index(CameraId::kBottom)];
  while (top.waiting_count > 0 && bottom.waiting_count > 0) {
    const int64_t bottom_minus_top = bottom.waiting[0].timestamp_ns - top.waiting[0].timestamp_ns;
    if (Match(bottom_minus_top)) return MakePair();
    // The older one has no partner: what comes later is further away still.
    mismatch_ns_ = std::abs(bottom_minus_top);
    DropOldest(bottom_minus_top > 0 ? CameraId::kTop : CameraId::kBottom);
  }
  return std::nullopt;
}

void FramePairer::Lose(CameraId id) {
  dropped_count_ = 0;
  DropAll(id);
  Forget(cameras_[Index(id)]);
  cameras_[Index(id)].lost = true;
}

void FramePairer::Restart() {
  for (Camera& camera : cameras_) {
    camera.waiting_count = 0;
    camera.lost = false;
    Forget(camera);
  }
}

void FramePairer::Forget(Camera& camera) const {
  camera.newest.reset();
  camera.interval_ns = nominal_interval_ns_;
  camera.restarted = true;
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

void FramePairer::DropAll(CameraId id) {
  while (cameras_[Index(id)].waiting_count > 0) DropOldest(id);
}

PictureTag FramePairer::TakeOldest(Camera& camera) {
  const PictureTag oldest = camera.waiting[0];
  std::move(camera.waiting.begin() + 1, camera.waiting.end(), camera.waiting.begin());
  --camera.waiting_count;
  return oldest;
}

bool FramePairer::Match(int64_t bottom_minus_top_ns) const {
  bool same_way_round = false;
  if (last_pair_ && last_pair_->is_whole() && !cameras_[0].restarted && !cameras_[1].restarted) {
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
  return Count(pair);
}

FramePair FramePairer::MakeAlone(CameraId id) {
  FramePair pair;
  pair.present = {id == CameraId::kTop, id == CameraId::kBottom};
  pair.pictures[Index(id)] = TakeOldest(cameras_[Index(id)]);
  return Count(pair);
}

FramePair FramePairer::Count(FramePair pair) {
  if (last_pair_) pair.sequence = last_pair_->sequence + Step(pair);
  for (const CameraId id : kBothCameras)
    if (pair.has(id)) cameras_[Index(id)].restarted = false;
  last_pair_ = pair;
  mismatch_ns_.reset();
  return pair;
}

/// Exposures since the last pair: as a camera that is in both of them counted, or by the time between.
uint64_t FramePairer::Step(const FramePair& pair) const {
  for (const CameraId id : kBothCameras) {
    if (!pair.has(id) || !last_pair_->has(id) || cameras_[Index(id)].restarted) continue;
    const uint32_t step = pair[id].sequence - (*last_pair_)[id].sequence;  // right across the wrap
    if (step >= 1 && step <= kMaxSequenceStep) return step;
  }
  const auto elapsed = static_cast<double>(pair.exposure_ns() - last_pair_->exposure_ns());
  return static_cast<uint64_t>(std::max(1.0, std::round(elapsed / nominal_interval_ns_)));
}

}  // namespace taclink
