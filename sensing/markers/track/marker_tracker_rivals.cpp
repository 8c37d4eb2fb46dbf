// MarkerTracker's third part: which labels another marker would explain as well.

#include <algorithm>
#include <cmath>

#include "sensing/markers/track/marker_tracker.h"

namespace taclink {
namespace {

constexpr double kRivalPx = 1.5, kRivalPart = 0.4;  // nearer than this, or part of what parts both
constexpr double kMergedPart = 1.5;                 // of the least distance: two spots may have become one
constexpr double kSinglePartOfPitch = 0.3;          // off the prediction, of one that a single camera found
constexpr int kRivals = 3;                          // rings to either side
constexpr int kRivalRounds = 2;
constexpr double kMostPushed = 0.7;  // of a marker's radius
constexpr double kLeastSlope = 0.1;  // of a ray along z

double DistanceToLine(const Vec2& p, const Vec2& a, const Vec2& b) {
  const Vec2 way = b - a;
  const double length2 = way.squaredNorm();
  const double t = length2 > 0 ? std::clamp((p - a).dot(way) / length2, 0.0, 1.0) : 0;
  return (p - a - t * way).norm();
}

}  // namespace

// A spot just found may as well be that of another marker without a label.
bool MarkerTracker::IsAmbiguous(const Camera& camera, int marker) const {
  const Track& track = camera.tracks[static_cast<size_t>(marker)];
  const double own = (track.pixel - track.expected).norm();
  bool ambiguous = false;
  const auto look = [&](size_t n) {
    const Track& other = camera.tracks[n];
    if (other.seen || !other.projects) return;
    const double apart = (other.expected - track.expected).norm();
    ambiguous |= (track.pixel - other.expected).norm() < own + std::max(kRivalPx, kRivalPart * apart);
  };
  EachNeighbour(marker, look);
  for (const int n : {marker - 2 * paths_, marker + 2 * paths_}) {
    if (n >= 0 && n < count_) look(static_cast<size_t>(n));
  }
  return ambiguous;
}

// The next marker of the path has no label and should be here, so that the spot may be its or that of both:
// it is nearer to the camera, or was lost in this frame.
bool MarkerTracker::IsOnAnother(CameraId id, int marker) const {
  const Camera& camera = cameras_[Index(id)];
  const Track& track = camera.tracks[static_cast<size_t>(marker)];
  if (!track.seen) return false;
  const double apart = check_.LeastDistancePx(id, marker);
  for (const int step : {-paths_, paths_}) {
    const int n = marker + step;
    if (n < 0 || n >= count_) continue;
    const Track& other = camera.tracks[static_cast<size_t>(n)];
    if (other.seen || !other.projects) continue;
    const bool nearer = (step < 0) == (id == CameraId::kTop);
    const double limit = other.lost_now ? kMergedPart * apart : apart;
    if ((nearer || other.lost_now) && (other.expected - track.pixel).squaredNorm() < limit * limit)
      return true;
  }
  return false;
}

// In the picture, against the rest shape: the most that the marker and the next ones of its path may be.
double MarkerTracker::DisplacedPx(CameraId id, int marker) const {
  const Camera& camera = cameras_[Index(id)];
  const Camera& other = cameras_[1 - Index(id)];
  double most = 0;
  for (const int n : {marker - paths_, marker, marker + paths_}) {
    if (n < 0 || n >= count_) continue;
    const auto m = static_cast<size_t>(n);
    const Track& track = camera.tracks[m];
    if (!track.seen && !track.projects) continue;
    const bool unseen = !track.seen && !other.tracks[m].seen && other.has_picture;
    const double unknown = unseen ? options_.unseen_mm * camera.scale_px_per_mm[m] : 0;
    const Vec2& pixel = track.seen ? track.pixel : track.expected;
    most = std::max(most, (pixel - camera.rest_px[m]).norm() + unknown);
  }
  return most;
}

// Where the other camera sees it, it is on that ray, and its z about between that predicted and that at rest.
MarkerTracker::Place MarkerTracker::FindPlace(CameraId id, int marker) const {
  const auto m = static_cast<size_t>(marker);
  const Camera& camera = cameras_[Index(id)];
  const double displaced = DisplacedPx(id, marker);
  const Vec3 &predicted = predicted_mm_[m], &rest = rest_mm_[m];
  if (IsSureOfRay(id, marker)) {
    const CameraId other = id == CameraId::kTop ? CameraId::kBottom : CameraId::kTop;
    const Track& track = cameras_[Index(other)].tracks[m];
    const auto direction = check_.projector(other).Ray(track.pixel - track.residual);
    const double half = 0.5 * std::abs(predicted.z() - rest.z()) + ZSlackMm(camera, marker, displaced);
    if (direction) {
      const SightRay ray{check_.projector(other).center_in_link(), *direction};
      const auto middle = ray.AtZ(0.5 * (predicted.z() + rest.z()));
      const double error = options_.prediction_px + options_.prediction_part_seen * displaced;
      const Vec3 way = ray.direction * (half / std::max(std::abs(ray.direction.z()), kLeastSlope));
      if (middle) return Along(id, marker, *middle, -way, way, error);
    }
  }
  const double error = options_.prediction_px + options_.prediction_part * displaced;
  Vec3 push = Vec3::Zero();
  if (cameras_[1 - Index(id)].has_picture) {
    const double radius = predicted.head<2>().norm();
    push.head<2>() = -std::min(options_.unseen_push_mm / radius, kMostPushed) * predicted.head<2>();
  }
  return Along(id, marker, predicted, Vec3::Zero(), push, error);
}

double MarkerTracker::ZSlackMm(const Camera& camera, int marker, double displaced_px) const {
  const double scale = camera.scale_px_per_mm[static_cast<size_t>(marker)];
  return std::min(options_.max_prediction_z_mm, options_.prediction_z_part * displaced_px / scale);
}

// In the picture, to first order: projecting costs more than all the rest.
MarkerTracker::Place MarkerTracker::Along(CameraId id, int marker, const Vec3& at, const Vec3& begin,
                                          const Vec3& end, double error_px) const {
  const auto projected = check_.projector(id).ProjectWithJacobian(at);
  if (!projected) return {};
  const Vec2 pixel = projected->pixel + cameras_[Index(id)].tracks[static_cast<size_t>(marker)].residual;
  return {pixel + projected->jacobian * begin, pixel + projected->jacobian * end, error_px, true};
}

// The other camera's label is none that was just found by a camera far away.
bool MarkerTracker::IsSureOfRay(CameraId id, int marker) const {
  const auto m = static_cast<size_t>(marker);
  const size_t other = 1 - Index(id);
  const bool near_top = rest_mm_[m].z() < check_.middle_z_mm();
  const bool other_is_nearer = near_top == (id == CameraId::kBottom);
  return HasLabel(kBothCameras[other], marker) && (other_is_nearer || fresh_[other][m] == 0);
}

const MarkerTracker::Place& MarkerTracker::PlaceOf(CameraId id, int marker) {
  const auto m = static_cast<size_t>(marker);
  Place& place = places_[Index(id)][m];
  if (place_known_[Index(id)][m] == 0) {
    place = FindPlace(id, marker);
    place_known_[Index(id)][m] = 1;
  }
  return place;
}

// What goes takes away what the others of its path were told from.
void MarkerTracker::DoubtRivalled() {
  for (auto& known : place_known_) std::fill(known.begin(), known.end(), uint8_t{0});
  for (int path = 0; path < paths_; ++path) {
    for (int round = 0, dropped = 1; round < kRivalRounds && dropped > 0; ++round) {
      dropped = 0;
      for (const CameraId id : kBothCameras) dropped += DoubtRivalled(id, path);
    }
  }
}

int MarkerTracker::DoubtRivalled(CameraId id, int path) {
  auto& doubtful = doubtful_[Index(id)];
  int dropped = 0;
  for (int i = path; i < count_; i += paths_) {
    const auto m = static_cast<size_t>(i);
    const bool alone =
        (i >= paths_ && !HasLabel(id, i - paths_)) || (i + paths_ < count_ && !HasLabel(id, i + paths_));
    if (!alone || !HasLabel(id, i) || !MayBeAnother(id, i)) continue;
    doubtful[m] = 1;
    place_known_[1 - Index(id)][m] = 0;
    ++dropped;
  }
  return dropped;
}

// By what costs little: the rival is further away than its place can be off the prediction.
bool MarkerTracker::IsFar(CameraId id, int rival, const Vec2& pixel, double touching_px) const {
  const auto m = static_cast<size_t>(rival);
  const Camera& camera = cameras_[Index(id)];
  const Track& track = camera.tracks[m];
  if (track.seen || !track.projects) return false;
  double far = touching_px + options_.unseen_push_mm * camera.scale_px_per_mm[m];
  const double away2 = (track.expected - pixel).squaredNorm();
  if (away2 > far * far) return true;
  if (!IsSureOfRay(id, rival)) return false;
  const double displaced = DisplacedPx(id, rival);
  const double off_mm = std::abs(predicted_mm_[m].z() - rest_mm_[m].z()) +
                        ZSlackMm(camera, rival, displaced) + options_.max_motion_mm;
  far = touching_px + 2 * options_.prediction_px + options_.prediction_part * displaced +
        off_mm * camera.scale_px_per_mm[m];
  return away2 > far * far;
}

// The spot may as well be that of one of the next markers of the path that have no label, or be nearer to it
// than to its own marker: both in one spot.
bool MarkerTracker::MayBeAnother(CameraId id, int marker) {
  const Camera& camera = cameras_[Index(id)];
  const Vec2& pixel = camera.tracks[static_cast<size_t>(marker)].pixel;
  const double touching = check_.LeastDistancePx(id, marker);
  const double margin = fresh_[Index(id)][static_cast<size_t>(marker)] != 0 ? options_.found_px : 0;
  for (const int step : {-paths_, paths_}) {
    for (int k = 1; k <= kRivals; ++k) {
      const int rival = marker + k * step;
      if (rival < 0 || rival >= count_ || HasLabel(id, rival)) break;
      if (IsFar(id, rival, pixel, touching + margin)) continue;
      const Place& place = PlaceOf(id, rival);
      if (!place.valid) continue;
      const double off = DistanceToLine(pixel, place.begin, place.end) - place.error_px - margin;
      if (off >= touching) continue;
      if (anew_ && !HasLabel(kBothCameras[1 - Index(id)], marker)) return true;
      const Place& own = PlaceOf(id, marker);
      if (!own.valid || off < DistanceToLine(pixel, own.begin, own.end) + own.error_px) return true;
    }
  }
  return false;
}

// Found again by one camera only: near to where it is predicted, and between neighbours on its path that were
// never lost, so that no other marker can be there.
bool MarkerTracker::SingleHolds(CameraId id, int marker) const {
  const Camera& camera = cameras_[Index(id)];
  const Track& track = camera.tracks[static_cast<size_t>(marker)];
  for (const int n : {marker - paths_, marker + paths_}) {
    if (n < 0 || n >= count_) continue;
    if (!camera.tracks[static_cast<size_t>(n)].seen || fresh_[Index(id)][static_cast<size_t>(n)] != 0)
      return false;
  }
  const double limit = kSinglePartOfPitch * LocalPitch(camera, marker, track.pixel);
  return (track.pixel - track.expected).squaredNorm() < limit * limit;
}

// As a prediction where there is none: on the nearer camera's ray where its ring is at rest, and between the
// rings of its path that are seen, whose ends are clamped.
void MarkerTracker::PredictFromLabels() {
  for (int path = 0; path < paths_; ++path) {
    int before = -1;
    double before_mm = 0;
    for (int ring = 0; ring <= rings_; ++ring) {
      const int marker = ring * paths_ + path;
      const bool end = ring == rings_;
      const auto seen = end ? std::nullopt : OnItsRing(marker);
      if (!end && !seen) continue;
      const double mm =
          seen ? seen->head<2>().norm() - rest_mm_[static_cast<size_t>(marker)].head<2>().norm() : 0;
      for (int j = before + 1; j < ring; ++j) {
        const auto m = static_cast<size_t>(j * paths_ + path);
        const double radius = rest_mm_[m].head<2>().norm();
        const double moved = before_mm + (mm - before_mm) * (j - before) / (ring - before);
        predicted_mm_[m] = rest_mm_[m];
        predicted_mm_[m].head<2>() *= (radius + moved) / radius;
      }
      if (seen) predicted_mm_[static_cast<size_t>(marker)] = *seen;
      before = ring;
      before_mm = mm;
    }
  }
  for (const CameraId id : kBothCameras) {
    for (Track& track : cameras_[Index(id)].tracks) track.lost_now = false;
    ExpectUnseen(id);
  }
}

std::optional<Vec3> MarkerTracker::OnItsRing(int marker) const {
  const auto m = static_cast<size_t>(marker);
  const bool near_top = rest_mm_[m].z() < check_.middle_z_mm();
  const CameraId nearer = near_top ? CameraId::kTop : CameraId::kBottom;
  const CameraId farther = near_top ? CameraId::kBottom : CameraId::kTop;
  for (const CameraId id : {nearer, farther}) {
    const Track& track = cameras_[Index(id)].tracks[m];
    const auto direction = track.seen ? check_.projector(id).Ray(track.pixel - track.residual) : std::nullopt;
    if (direction) return SightRay{check_.projector(id).center_in_link(), *direction}.AtZ(rest_mm_[m].z());
  }
  return std::nullopt;
}

}  // namespace taclink
