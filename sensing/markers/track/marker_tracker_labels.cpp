// MarkerTracker's second half: which labels are kept, and when the full pictures are needed.

#include <algorithm>
#include <cmath>
#include <limits>

#include "sensing/markers/track/marker_tracker.h"

namespace taclink {
namespace {

constexpr double kCheckAgainPx = 0.3;        // what moved less since its last check needs no other
constexpr int kFirstRetry = 8;               // frames
constexpr int kFewLost = 8;                  // so many at once are no loss
constexpr double kConflictPx = 2;            // two results for one marker further apart than that
constexpr double kUnclippedVariance = 0.01;  // px^2, of a spot that was only seen clipped before
constexpr double kClippedPart = 0.0625;      // variance of a clipped spot over its area; as in MarkerDetector
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

}  // namespace

void MarkerTracker::WriteLabels(LabelledMarkers& labels) {
  for (size_t c = 0; c < kCameraCount; ++c) {
    labels.cameras[c].resize(static_cast<size_t>(count_));
    for (size_t i = 0; i < labels.cameras[c].size(); ++i) {
      const Track& track = cameras_[c].tracks[i];
      MarkerObservation& label = labels.cameras[c][i];
      label.seen = track.seen;
      labelled_[c][i] = track.seen ? 1 : 0;
      label.center_px = track.pixel;
      label.covariance_px2 =
          track.clipped ? Mat2(kClippedPart * track.size.area_px2 * Mat2::Identity()) : track.covariance;
    }
  }
}

void MarkerTracker::Check(LabelledMarkers& labels, TrackingReport& report) {
  WriteLabels(labels);
  CheckAll(labels, report);
  JudgeLoss();
}

void MarkerTracker::CheckAll(LabelledMarkers& labels, TrackingReport& report) {
  for (const CameraId id : kBothCameras) {
    auto& doubtful = doubtful_[Index(id)];
    std::fill(doubtful.begin(), doubtful.end(), uint8_t{0});
    if (cameras_[Index(id)].has_picture) {
      check_.CheckPicture(id, labels.cameras[Index(id)], fresh_[Index(id)], doubtful);
    }
  }
  for (int i = 0; i < count_; ++i) CheckMarker(i);
  DoubtRivalled();
  for (size_t c = 0; c < kCameraCount; ++c) {
    for (size_t i = 0; i < doubtful_[c].size(); ++i) {
      if (doubtful_[c][i] == 0) continue;
      Drop(cameras_[c].tracks[i]);
      labels.cameras[c][i].seen = false;
      ++report.cameras[c].dropped;
    }
  }
}

void MarkerTracker::CheckMarker(int marker) {
  const auto m = static_cast<size_t>(marker);
  for (size_t c = 0; c < kCameraCount; ++c) {
    const bool doubt =
        fresh_[c][m] != 0 ? IsAmbiguous(cameras_[c], marker) : IsOnAnother(kBothCameras[c], marker);
    if (doubt) doubtful_[c][m] = 1;
  }
  std::array<Track*, kCameraCount> tracks;
  std::array<bool, kCameraCount> sure;
  for (size_t c = 0; c < kCameraCount; ++c) {
    tracks[c] = &cameras_[c].tracks[m];
    sure[c] = tracks[c]->seen && doubtful_[c][m] == 0;
  }
  if (sure[0] && sure[1]) {
    const bool any_fresh = fresh_[0][m] != 0 || fresh_[1][m] != 0;
    bool moved = any_fresh;
    for (const Track* track : tracks) {
      moved |= (track->pixel - track->checked).squaredNorm() > kCheckAgainPx * kCheckAgainPx;
    }
    if (!moved) return;
    const double sigma = std::sqrt(tracks[0]->covariance.trace() + tracks[1]->covariance.trace());
    const auto pair = check_.CheckPair(marker, {tracks[0]->pixel, tracks[1]->pixel}, sigma);
    bool holds = pair.holds;
    // One that was followed is held against its own past: the shape may lag behind.
    const double expected_z = any_fresh ? predicted_mm_[m].z() : pair_z_mm_[m];
    for (const CameraId id : kBothCameras) {
      const bool unknown = !any_fresh && std::isnan(pair_z_mm_[m]);
      if (!followed_ || unknown || (any_fresh && fresh_[Index(id)][m] == 0)) continue;
      const double part = any_fresh ? options_.max_slip_found : options_.max_slip_followed;
      const double slip = check_.SlipMm(id, marker, pair.point_mm);
      holds = holds && std::abs(pair.point_mm.z() - expected_z) < part * slip;
    }
    for (const CameraId id : kBothCameras) {
      const double slip = check_.SlipMm(id, marker, pair.point_mm);
      if (std::abs(pair.point_mm.z() - rest_mm_[m].z()) < options_.max_slip_from_rest * slip) continue;
      doubtful_[Index(id)][m] = 1;
      pair_z_mm_[m] = kUnknown;
      return;
    }
    for (size_t c = 0; c < kCameraCount; ++c) {
      pair_z_mm_[m] = holds ? pair.point_mm.z() : kUnknown;
      if (holds) {
        tracks[c]->checked = tracks[c]->pixel;
      } else if (!any_fresh || fresh_[c][m] != 0) {
        doubtful_[c][m] = 1;
      }
    }
    return;
  }
  pair_z_mm_[m] = kUnknown;
  for (const CameraId id : kBothCameras) {
    const auto c = Index(id);
    if (sure[c] && fresh_[c][m] != 0 && !SingleHolds(id, marker)) doubtful_[c][m] = 1;
  }
}

// Lost in this frame, and off their places at rest when seen last.
int MarkerTracker::CountLostDisplaced(const Camera& camera) const {
  int count = 0;
  for (size_t i = 0; i < camera.tracks.size(); ++i) {
    const Track& track = camera.tracks[i];
    const double displaced_px = options_.displaced_part * camera.rest_pitch_px[i];
    if (track.lost_now && (track.pixel - camera.rest_px[i]).squaredNorm() > displaced_px * displaced_px)
      ++count;
  }
  return count;
}

void MarkerTracker::JudgeLoss() {
  ++since_acquire_;
  wants_ = AcquireReason::kNone;
  int before = 0, now = 0, displaced = 0;
  for (const Camera& camera : cameras_) {
    if (!camera.has_picture) continue;
    if (!camera.had_picture) wants_ = AcquireReason::kCamera;
    before += camera.seen_before;
    now += CountSeen(camera);
    displaced += CountLostDisplaced(camera);
  }
  if (wants_ != AcquireReason::kNone) return;
  if (before - now > std::max<double>(kFewLost, options_.max_loss * before) ||
      displaced > options_.max_loss_displaced) {
    wants_ = AcquireReason::kLoss;
    return;
  }
  const bool few =
      now < options_.retry_below * count_ * (cameras_[0].has_picture + cameras_[1].has_picture) ||
      now < (1 - options_.max_loss) * seen_at_acquire_;
  if (!few) {
    retry_frames_ = kFirstRetry;
  } else if (since_acquire_ >= retry_frames_) {
    wants_ = AcquireReason::kRetry;
    retry_frames_ = std::min(2 * retry_frames_, options_.max_retry_frames);
  }
}

void MarkerTracker::Adopt(const Pictures& gray, const LabelledMarkers& acquired, LabelledMarkers& labels,
                          TrackingReport& report) {
  // After a loss, what was followed is not trusted.
  anew_ = !followed_ || wants_ == AcquireReason::kLoss;
  int found = 0, tracked = 0;
  for (size_t c = 0; c < kCameraCount; ++c) {
    Camera& camera = cameras_[c];
    for (Track& track : camera.tracks) {
      if (anew_) Drop(track);
    }
    tracked += CountSeen(camera);
    for (const MarkerObservation& label : acquired.cameras[c]) found += label.seen ? 1 : 0;
    camera.has_picture = !gray[c].empty();
    std::fill(fresh_[c].begin(), fresh_[c].end(), uint8_t{0});
  }
  if (found >= tracked) {
    for (size_t c = 0; c < kCameraCount; ++c) {
      for (int i = 0; i < count_ && cameras_[c].has_picture; ++i) {
        Take(cameras_[c], gray[c], i, acquired.cameras[c][static_cast<size_t>(i)]);
      }
    }
  }
  if (anew_) PredictFromLabels();
  WriteLabels(labels);
  CheckAll(labels, report);
  anew_ = false;
  since_acquire_ = 0;
  seen_at_acquire_ = 0;
  for (const Camera& camera : cameras_) seen_at_acquire_ += CountSeen(camera);
  followed_ = false;
  wants_ = AcquireReason::kNone;
}

// Takes a label from the full picture. Where the track has another spot, one of both is wrong.
void MarkerTracker::Take(Camera& camera, const cv::Mat& gray, int marker, const MarkerObservation& label) {
  Track& track = camera.tracks[static_cast<size_t>(marker)];
  if (!label.seen) return;
  const double far = kConflictPx + 0.1 * track.size.width_px;
  if (track.seen && (track.pixel - label.center_px).squaredNorm() > far * far) return Drop(track);
  const Size& rest = camera.rest_sizes[static_cast<size_t>(marker)];
  track.pixel = label.center_px;
  track.velocity.setZero();
  track.motion.setZero();
  track.checked = Vec2::Constant(-1e3);
  track.covariance = label.covariance_px2;
  track.seen = track.known = true;
  track.clipped = false;
  track.bias.setZero();
  track.patch.Clear();
  const double reach = 1.5 + 0.1 * std::max(rest.width_px, rest.height_px);
  const WindowTarget target{label.center_px,
                            reach,
                            1.3 * rest.width_px,
                            1.3 * rest.height_px,
                            rest.area_px2,
                            camera.contrast,
                            camera.max_spread_px2[static_cast<size_t>(marker)],
                            4,
                            3};
  if (!measure_.Find(gray, target, blob_)) return;
  const Vec2 bias = label.center_px - blob_.center_px;
  if (bias.squaredNorm() > reach * reach) return;
  track.bias = bias;
  camera.contrast += 0.05 * (blob_.contrast - camera.contrast);
  TakeReference(gray, track);
  if (track.clipped) track.covariance = kUnclippedVariance * Mat2::Identity();
}

void MarkerTracker::Forget() {
  for (Camera& camera : cameras_) {
    for (Track& track : camera.tracks) {
      Drop(track);
      track.known = false;
    }
  }
  followed_ = false;
  wants_ = AcquireReason::kFirst;
}

int MarkerTracker::seen(CameraId id) const {
  return CountSeen(cameras_[Index(id)]);
}

}  // namespace taclink
