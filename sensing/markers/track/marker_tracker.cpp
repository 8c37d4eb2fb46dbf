#include "sensing/markers/track/marker_tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace taclink {
namespace {

constexpr int kMaxPatch = 512;                        // px
constexpr int kAhead = 2;                             // markers whose patches are fetched early
constexpr double kSteadyPx = 0.4;                     // a smaller motion predicts nothing: it may be noise
constexpr double kMaxNoiseRatio = 2.5;                // of a patch's residual over the median one
constexpr double kModelError = 0.05;                  // of the contrast: what a patch may be off beside noise
constexpr double kNoiseStep = 0.002;                  // of the running median
constexpr double kRenewPx = 0.75, kRenewSize = 0.05;  // moved by more: a new reference
constexpr double kPartOfPitch = 0.45;  // a spot further than that from its place may be the next marker's
constexpr double kMinReachPx = 1.2;
constexpr double kGrowth = 1.35, kLostGrowth = 1.5, kUnknownGrowth = 3;  // of the area
constexpr double kLostLooseness = 1.3;
constexpr double kUnknownLooseness = 2.2;                // for spots whose size is only known from the model
constexpr double kMaxSpread = 1.6, kBlurVariance = 0.6;  // px^2
constexpr double kMaxResidualPx = 3, kResidualWeight = 0.3;
constexpr int kResidualStride = 32;  // each frame, every so many markers teach the residuals

constexpr double kSamePlaceMm = 0.2;  // projecting costs more than all the rest

}  // namespace

MarkerTracker::MarkerTracker(const SimilarSkin& skin, MarkerTrackerOptions options)
    : options_(options),
      scale_(skin.scale),
      paths_(skin.model.markers.paths),
      rings_(skin.model.markers.rings()),
      count_(skin.model.markers.count()),
      check_(skin.model, skin.rig, options.check),
      rest_mm_(skin.model.RestMarkers()),
      pair_z_mm_(rest_mm_.size(), std::numeric_limits<double>::quiet_NaN()),
      predicted_mm_(rest_mm_) {
  for (const CameraId id : kBothCameras) {
    PrepareCamera(skin.model, id);
    doubtful_[Index(id)].assign(static_cast<size_t>(count_), 0);
    fresh_[Index(id)].assign(static_cast<size_t>(count_), 0);
    places_[Index(id)].resize(static_cast<size_t>(count_));
    place_known_[Index(id)].assign(static_cast<size_t>(count_), 0);
    labelled_[Index(id)].assign(static_cast<size_t>(count_), 0);
  }
}

void MarkerTracker::PrepareCamera(const LinkModel& model, CameraId id) {
  Camera camera;
  const double radius = 0.5 * model.markers.diameter_mm, disc = kPi * radius * radius;
  std::vector<std::optional<Vec2>> pixels;
  for (const Vec3& p : rest_mm_) {
    const auto seen = check_.projector(id).ProjectWithJacobian(p);
    pixels.push_back(seen ? std::optional(seen->pixel) : std::nullopt);
    Size size{.width_px = 8, .height_px = 8, .area_px2 = 50, .contrast = camera.contrast};
    double scale = 1;
    if (seen) {
      // The disc laid on the skin, or the dome seen from the side where that is more.
      const Vec2 across = seen->jacobian * Vec3(-p.y(), p.x(), 0).normalized();
      const Vec2 along = seen->jacobian * Vec3::UnitZ();
      const double flat = std::abs(across.x() * along.y() - across.y() * along.x()) * disc;
      const Vec2 extent = 2 * radius * seen->jacobian.rowwise().norm();
      size = {extent.x(), extent.y(), std::max(flat, across.squaredNorm() * disc / 2), camera.contrast};
      scale = seen->jacobian.norm() / std::sqrt(2.0);
    }
    camera.rest_sizes.push_back(size);
    camera.scale_px_per_mm.push_back(scale);
    camera.max_spread_px2.push_back(MaxSpread(model, id, p));
    const auto width = static_cast<int>(1.3 * size.width_px + 4),
               height = static_cast<int>(1.3 * size.height_px + 4);
    camera.tracks.emplace_back(std::min((width + 7) / 8 * 8 * height, kMaxPatch));
    camera.tracks.back().size = size;
  }
  for (int i = 0; i < count_; ++i) {
    Track& track = camera.tracks[static_cast<size_t>(i)];
    track.pixel = pixels[static_cast<size_t>(i)].value_or(track.pixel);
    camera.rest_px.push_back(track.pixel);
  }
  for (int i = 0; i < count_; ++i) {
    double pitch = 40;
    EachNeighbour(i, [&](size_t n) {
      if (pixels[n] && pixels[static_cast<size_t>(i)])
        pitch = std::min(pitch, (*pixels[n] - *pixels[static_cast<size_t>(i)]).norm());
    });
    camera.rest_pitch_px.push_back(pitch);
  }
  cameras_.push_back(std::move(camera));
}

// Of a marker's spot: that of the dome's whole disc, pushed in as far as it goes and so nearest to the
// camera.
double MarkerTracker::MaxSpread(const LinkModel& model, CameraId id, const Vec3& rest) const {
  const double radius = rest.head<2>().norm();
  const double least = std::min(radius, std::max(model.tube_outer_radius_mm, 0.4 * radius));
  Vec3 pushed = rest;
  pushed.head<2>() *= least / radius;
  double size = 0;
  for (const Vec3& p : {rest, pushed}) {
    const auto seen = check_.projector(id).ProjectWithJacobian(p);
    if (seen) size = std::max(size, model.markers.diameter_mm * seen->jacobian.rowwise().norm().maxCoeff());
  }
  return size > 0 ? kMaxSpread * (size * size / 16 + kBlurVariance) : 1e9;
}

// To the nearest neighbour's label; what is further off than about half of it may be that neighbour.
double MarkerTracker::LocalPitch(const Camera& camera, int marker, const Vec2& pixel) const {
  double pitch2 = std::numeric_limits<double>::infinity();
  EachNeighbour(marker, [&](size_t n) {
    if (camera.tracks[n].seen) pitch2 = std::min(pitch2, (camera.tracks[n].pixel - pixel).squaredNorm());
  });
  return std::min(std::sqrt(pitch2), 1.5 * camera.rest_pitch_px[static_cast<size_t>(marker)]);
}

double MarkerTracker::Reach(const Camera& camera, int marker, const Vec2& expected, double motion_mm) const {
  const double motion = 1 + motion_mm * camera.scale_px_per_mm[static_cast<size_t>(marker)];
  return std::max(kMinReachPx, std::min(motion, kPartOfPitch * LocalPitch(camera, marker, expected)));
}

void MarkerTracker::Follow(const Pictures& gray, std::span<const Vec3> predicted_mm, TrackingReport& report) {
  followed_ = true;
  ++frame_;
  if (predicted_mm.size() == rest_mm_.size()) {
    std::transform(predicted_mm.begin(), predicted_mm.end(), predicted_mm_.begin(),
                   [&](const Vec3& p) -> Vec3 { return scale_ * p; });
  } else {
    predicted_mm_ = rest_mm_;
  }
  for (const CameraId id : kBothCameras) {
    const auto c = Index(id);
    Camera& camera = cameras_[c];
    CameraTracking& counts = report.cameras[c];
    counts = {};
    camera.had_picture = camera.has_picture;
    camera.has_picture = gray[c].type() == CV_8UC1 && !gray[c].empty();
    camera.seen_before = CountSeen(camera);
    camera.pixels_read = 0;
    std::fill(fresh_[c].begin(), fresh_[c].end(), uint8_t{0});
    if (!camera.has_picture) {
      for (Track& track : camera.tracks) Drop(track);
      continue;
    }
    // The prediction is of the frame before, as the labels still are.
    LearnResiduals(id);
    FollowSeen(camera, gray[c], counts);
    if (camera.had_picture) Search(id, gray[c], counts);
    counts.share_read =
        std::min(1.0, static_cast<double>(camera.pixels_read) / static_cast<double>(gray[c].total()));
  }
}

void MarkerTracker::SetUntouched(std::span<const Vec3> untouched_mm) {
  if (untouched_mm.size() != rest_mm_.size()) return;
  for (size_t m = 0; m < rest_mm_.size(); ++m) {
    const Vec3 place = scale_ * untouched_mm[m];
    if ((place - rest_mm_[m]).squaredNorm() < kSamePlaceMm * kSamePlaceMm) continue;
    rest_mm_[m] = place;
    for (const CameraId id : kBothCameras) {
      if (const auto pixel = check_.projector(id).Project(place)) cameras_[Index(id)].rest_px[m] = *pixel;
    }
  }
}

void MarkerTracker::FollowSeen(Camera& camera, const cv::Mat& gray, CameraTracking& counts) {
  for (int i = 0; i < count_; ++i) {
    Track& track = camera.tracks[static_cast<size_t>(i)];
    if (i + kAhead < count_) camera.tracks[static_cast<size_t>(i + kAhead)].patch.Prefetch();
    track.lost_now = false;
    if (!track.seen) continue;
    if (Verify(gray, track, camera)) {
      ++counts.verified;
      continue;
    }
    const Vec2 expected = track.pixel + track.velocity;
    const double reach = Reach(camera, i, expected, options_.max_motion_mm);
    if (MeasureAnew(gray, expected, reach, 1, i, camera)) {
      ++counts.measured;
    } else {
      Drop(track);
      track.expected = expected;
      track.projects = track.lost_now = true;
      ++counts.dropped;
    }
  }
}

bool MarkerTracker::Verify(const cv::Mat& gray, Track& track, Camera& camera) {
  if (track.patch.empty()) return false;
  camera.pixels_read += track.patch.pixels();
  auto shift = track.patch.Register(gray, track.pixel + track.velocity);
  if (shift.valid && shift.off_whole_px > options_.max_shift_px && shift.off_whole_px < 1.5) {
    shift = track.patch.Register(gray, shift.center_px);
  }
  if (!shift.valid || shift.off_whole_px > options_.max_shift_px) return false;
  noise2_ = std::clamp(noise2_ * (shift.residual2 > noise2_ ? 1 + kNoiseStep : 1 - kNoiseStep), 0.3, 400.0);
  const double model_error = kModelError * track.size.contrast * shift.gain;
  const double renew = kRenewPx + kRenewSize * std::max(track.size.width_px, track.size.height_px);
  if (shift.residual2 > kMaxNoiseRatio * noise2_ + model_error * model_error ||
      (shift.center_px - track.patch.center_px()).squaredNorm() > renew * renew || shift.gain < 0.5 ||
      shift.gain > 2) {
    return false;
  }
  MoveTo(shift.center_px, track);
  track.gain = shift.gain;
  return true;
}

// The part of the last two motions that they agree in: noise predicts nothing, nor does a stop go on.
void MarkerTracker::MoveTo(const Vec2& pixel, Track& track) {
  const Vec2 motion = pixel - track.pixel;
  for (int k = 0; k < 2; ++k) {
    const double least = std::min(std::abs(motion[k]), std::abs(track.motion[k]));
    track.velocity[k] = motion[k] * track.motion[k] > 0 ? std::copysign(least, motion[k]) : 0;
  }
  if (track.velocity.squaredNorm() < kSteadyPx * kSteadyPx) track.velocity.setZero();
  track.motion = motion;
  track.pixel = pixel;
}

bool MarkerTracker::MeasureAnew(const cv::Mat& gray, const Vec2& expected, double reach, double looseness,
                                int marker, Camera& camera) {
  Track& track = camera.tracks[static_cast<size_t>(marker)];
  const Size& size = track.size;
  const bool found = measure_.Find(gray,
                                   {.expected_px = expected - track.bias,
                                    .reach_px = reach,
                                    .width_px = size.width_px,
                                    .height_px = size.height_px,
                                    .area_px2 = size.area_px2,
                                    .contrast = track.gain * size.contrast,
                                    .max_spread_px2 = camera.max_spread_px2[static_cast<size_t>(marker)],
                                    .max_growth = looseness > kLostLooseness ? kUnknownGrowth
                                                  : looseness > 1            ? kLostGrowth
                                                                             : kGrowth,
                                    .looseness = looseness},
                                   blob_);
  camera.pixels_read += measure_.pixels();
  if (!found) return false;
  MoveTo(blob_.center_px + track.bias, track);
  TakeReference(gray, track);
  return true;
}

// The spot in blob_ is what the marker looks like from now on.
void MarkerTracker::TakeReference(const cv::Mat& gray, Track& track) {
  track.size = {static_cast<double>(blob_.x_end - blob_.x_begin),
                static_cast<double>(blob_.y_end - blob_.y_begin), blob_.area_px2, blob_.contrast};
  track.gain = 1;
  track.clipped = blob_.clipped;
  track.patch.Take(gray, blob_, track.pixel);
}

// Often after a loss, then every eighth frame, by turns.
bool MarkerTracker::IsTurnToSearch(const Track& track, int marker) const {
  return track.missing <= 4 || (track.missing <= 16 && (frame_ + marker) % 2 == 0) ||
         (frame_ + marker) % 8 == 0;
}

// Where the unseen markers should be.
void MarkerTracker::ExpectUnseen(CameraId id) {
  for (size_t i = 0; i < static_cast<size_t>(count_); ++i) {
    Track& track = cameras_[Index(id)].tracks[i];
    if (track.seen || track.lost_now) continue;
    ++track.missing;
    const auto projected = check_.projector(id).Project(predicted_mm_[i]);
    track.projects = projected.has_value();
    if (projected) track.expected = *projected + track.residual;
  }
}

void MarkerTracker::Search(CameraId id, const cv::Mat& gray, CameraTracking& counts) {
  Camera& camera = cameras_[Index(id)];
  ExpectUnseen(id);
  for (int i = 0; i < count_; ++i) {
    const auto m = static_cast<size_t>(i);
    Track& track = camera.tracks[m];
    if (track.seen || track.lost_now || !track.projects || !IsTurnToSearch(track, i)) continue;
    ++counts.searched;
    const double looseness = track.known ? kLostLooseness : kUnknownLooseness;
    const double reach = Reach(camera, i, track.expected, options_.max_motion_mm);
    if (!MeasureAnew(gray, track.expected, reach, looseness, i, camera)) continue;
    track.velocity.setZero();
    track.motion.setZero();
    track.seen = true;
    fresh_[Index(id)][m] = 1;
    ++counts.found;
  }
}

// A spot's centre is not quite the projection of the point that the model calls the marker.
void MarkerTracker::LearnResiduals(CameraId id) {
  Camera& camera = cameras_[Index(id)];
  // All of them after the first frame.
  const int stride = camera.learned ? kResidualStride : 1;
  const double weight = camera.learned ? kResidualWeight : 1;
  camera.learned = true;
  for (int i = frame_ % stride; i < count_; i += stride) {
    Track& track = camera.tracks[static_cast<size_t>(i)];
    if (!track.seen) continue;
    const auto projected = check_.projector(id).Project(predicted_mm_[static_cast<size_t>(i)]);
    if (!projected) continue;
    const Vec2 residual = track.pixel - *projected;
    if (residual.squaredNorm() < kMaxResidualPx * kMaxResidualPx) {
      track.residual += weight * (residual - track.residual);
    }
  }
}

void MarkerTracker::Drop(Track& track) {
  if (track.seen) track.missing = 0;
  track.seen = false;
  track.velocity.setZero();
}

int MarkerTracker::CountSeen(const Camera& camera) {
  int seen = 0;
  for (const Track& track : camera.tracks) seen += track.seen ? 1 : 0;
  return seen;
}

}  // namespace taclink
