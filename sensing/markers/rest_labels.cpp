#include "sensing/markers/rest_labels.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <optional>
#include <string>

#include "sensing/camera/projection.h"

namespace taclink {
namespace {

constexpr double kSearchHalfWidth = 64, kSearchStep = 4;    // px around the nominal principal point
constexpr double kMinCoherence = 0.55;                      // of the path angles; 1: all on lines, 0: none
constexpr double kSector = 0.25;                            // path pitches off a line
constexpr double kRingGate = 0.4;                           // of the distance to the next ring
constexpr double kMinSeen = 0.5;                            // of all markers
constexpr double kMaxScaleOff = 0.35, kMaxShapeOff = 0.15;  // log radius against the nominal lens

struct Star {  // lines through a point, evenly spaced
  Vec2 center = Vec2::Zero();
  double roll_rad = 0;  // against the nominal path angles in the picture
};

struct Spot {
  int detection = 0, path = 0;
  double log_radius = 0;
};

double Wrap(double angle) {
  return std::remainder(angle, 2 * kPi);
}

class RestLabeller {
 public:
  RestLabeller(const LinkModel& model, CameraId id, const Detections& detections)
      : model_(model), camera_(model.nominal_rig[id]), id_(id), detections_(detections) {
    // Where paths lie in the picture: the axes of the link in the camera's frame, seen along the axis.
    for (int l = 0; l < model.markers.paths; ++l) {
      const double angle = model.PathAngle(l);
      const Vec3 d = camera_.camera_from_link.rotation * Vec3(std::cos(angle), std::sin(angle), 0);
      picture_angles_.push_back(std::atan2(d.y(), d.x()));
    }
  }

  Result<std::vector<MarkerObservation>> Run() {
    if (static_cast<double>(detections_.size()) < kMinSeen * model_.markers.count())
      return Refusal("only " + std::to_string(detections_.size()) + " spots found");
    const double coherence = FindCenter();
    if (coherence < kMinCoherence) return Refusal("the spots do not lie on paths through one point");
    RefineStar();
    SortIntoPaths();
    if (auto fitted = FindRings(); !fitted) return fitted.error();
    return Observations();
  }

 private:
  Error Refusal(const std::string& why) const {
    return {ErrorCode::kInvalidArgument,
            "the " + std::string(Name(id_)) + " camera's rest picture can't be labelled: " + why +
                "; check the light, the link model and that nothing touches the skin"};
  }

  // Mean of exp(i n (angle - angle of path 0)) over all detections: of modulus 1 when all lie on paths.
  std::complex<double> Coherence(const Vec2& center) const {
    std::complex<double> sum = 0;
    int count = 0;
    for (const Detection& d : detections_) {
      if (d.clipped) continue;
      const Vec2 at = d.center_px - center;
      const double angle = std::atan2(at.y(), at.x()) - picture_angles_[0];
      sum += std::polar(1.0, model_.markers.paths * angle);
      ++count;
    }
    return sum / static_cast<double>(std::max(1, count));
  }

  double FindCenter() {
    double best = -1;
    const Vec2 start = camera_.lens.principal_point_px;
    for (double y = -kSearchHalfWidth; y <= kSearchHalfWidth; y += kSearchStep) {
      for (double x = -kSearchHalfWidth; x <= kSearchHalfWidth; x += kSearchStep) {
        const auto coherence = Coherence(start + Vec2(x, y));
        if (std::abs(coherence) <= best) continue;
        best = std::abs(coherence);
        star_ = {start + Vec2(x, y), std::arg(coherence) / model_.markers.paths};
      }
    }
    return best;
  }

  struct Place {
    int path;
    double off_rad;
  };
  Place NearestPath(double picture_angle) const {
    Place best{0, 2 * kPi};
    for (int l = 0; l < model_.markers.paths; ++l) {
      const double off = Wrap(picture_angle - picture_angles_[static_cast<size_t>(l)] - star_.roll_rad);
      if (std::abs(off) < std::abs(best.off_rad)) best = {l, off};
    }
    return best;
  }

  // Least squares for centre and roll: a spot's distance across its line is n . (p - center) - r roll.
  void RefineStar() {
    const double gate = kSector * model_.markers.path_pitch_rad();
    for (int iteration = 0; iteration < 8; ++iteration) {
      Mat3 normal = Mat3::Zero();
      Vec3 right = Vec3::Zero();
      for (const Detection& d : detections_) {
        const Vec2 at = d.center_px - star_.center;
        const double r = at.norm();
        const Place place = NearestPath(std::atan2(at.y(), at.x()));
        if (d.clipped || std::abs(place.off_rad) > gate || r < 1) continue;
        const double line = std::atan2(at.y(), at.x()) - place.off_rad;
        const Vec3 row(-std::sin(line), std::cos(line), r);
        normal += row * row.transpose();
        right += row * (r * std::sin(place.off_rad));
      }
      const Vec3 step = normal.ldlt().solve(right);
      if (!step.allFinite()) return;
      star_.center += step.head<2>();
      star_.roll_rad += step.z();
    }
  }

  void SortIntoPaths() {
    by_path_.resize(static_cast<size_t>(model_.markers.paths));
    const double gate = kSector * model_.markers.path_pitch_rad();
    for (size_t i = 0; i < detections_.size(); ++i) {
      const Vec2 at = detections_[i].center_px - star_.center;
      const Place place = NearestPath(std::atan2(at.y(), at.x()));
      if (std::abs(place.off_rad) > gate || at.norm() < 1) continue;
      by_path_[static_cast<size_t>(place.path)].push_back(
          {static_cast<int>(i), place.path, std::log(at.norm())});
    }
    for (auto& path : by_path_) {  // near, large radius, first
      std::sort(path.begin(), path.end(),
                [](const Spot& a, const Spot& b) { return a.log_radius > b.log_radius; });
    }
  }

  // Rings counted from the camera's end. NaN: the nominal lens can't see it.
  std::vector<double> NominalLogRadii() const {
    std::vector<double> radii;
    const Projector projector(camera_);
    for (int i = 0; i < model_.markers.rings(); ++i) {
      const auto pixel = projector.Project(model_.RestMarker(model_.MarkerIndex(0, RingFromNear(i))));
      radii.push_back(pixel ? std::log((*pixel - camera_.lens.principal_point_px).norm())
                            : std::numeric_limits<double>::quiet_NaN());
    }
    return radii;
  }
  int RingFromNear(int i) const { return id_ == CameraId::kTop ? i : model_.markers.rings() - 1 - i; }

  /// The count of spots that most paths have (the larger of two), at most one per ring.
  size_t UsualCount() const {
    std::vector<int> votes(static_cast<size_t>(model_.markers.rings()) + 1, 0);
    for (const auto& path : by_path_) {
      if (path.size() < votes.size()) ++votes[path.size()];
    }
    size_t usual = 0;
    for (size_t n = 2; n < votes.size(); ++n) {
      if (votes[n] >= std::max(1, votes[usual])) usual = n;
    }
    return usual;
  }

  // What every ring's radius is: the median over the paths that have the usual count, at the place in the
  // sequence where the nominal lens agrees best; further rings by the nominal lens, scaled alike.
  Result<void> FindRings() {
    const size_t usual = UsualCount();
    if (usual < 2 || static_cast<double>(usual) < kMinSeen * model_.markers.rings())
      return Refusal("most paths have too few spots");
    std::vector<double> medians;
    for (size_t i = 0; i < usual; ++i) {
      std::vector<double> values;
      for (const auto& path : by_path_) {
        if (path.size() == usual) values.push_back(path[i].log_radius);
      }
      std::nth_element(values.begin(), values.begin() + static_cast<long>(values.size() / 2), values.end());
      medians.push_back(values[values.size() / 2]);
    }
    const std::vector<double> nominal = NominalLogRadii();
    double best = std::numeric_limits<double>::infinity(), best_scale = 0;
    size_t best_skip = 0;
    for (size_t skip = 0; skip + usual <= nominal.size(); ++skip) {
      const auto [scale, spread] = Compare(medians, nominal, skip);
      // A scale near 1 counts a little: without it two rings of two would fit anywhere.
      const double cost = spread + 0.1 * std::abs(scale);
      if (cost < best) best = cost, best_scale = scale, best_skip = skip;
    }
    const auto [scale, spread] = Compare(medians, nominal, best_skip);
    if (!(std::abs(scale) < kMaxScaleOff && spread < kMaxShapeOff))
      return Refusal("the rings' distances do not fit the model");
    ring_log_radii_.clear();
    for (size_t i = 0; i < nominal.size(); ++i) {
      const bool measured = i >= best_skip && i < best_skip + usual;
      ring_log_radii_.push_back(measured ? medians[i - best_skip] : nominal[i] + best_scale);
    }
    return {};
  }

  struct Agreement {
    double scale, spread;  // mean and standard deviation of the log radius against the nominal one
  };
  static Agreement Compare(const std::vector<double>& medians, const std::vector<double>& nominal,
                           size_t skip) {
    double sum = 0, squares = 0, count = 0;
    for (size_t i = 0; i < medians.size(); ++i) {
      const double off = medians[i] - nominal[i + skip];
      if (std::isnan(off)) continue;
      sum += off, squares += off * off, ++count;
    }
    const double mean = sum / std::max(1.0, count);
    return {mean, std::sqrt(std::max(0.0, squares / std::max(1.0, count) - mean * mean))};
  }

  Result<std::vector<MarkerObservation>> Observations() const {
    std::vector<MarkerObservation> seen(static_cast<size_t>(model_.markers.count()));
    std::vector<double> off(seen.size(), std::numeric_limits<double>::infinity());
    for (const auto& path : by_path_) {
      for (const Spot& spot : path) {
        const auto ring = NearestRing(spot.log_radius);
        if (!ring) continue;
        const auto marker = static_cast<size_t>(model_.MarkerIndex(spot.path, RingFromNear(*ring)));
        const double distance = std::abs(spot.log_radius - ring_log_radii_[static_cast<size_t>(*ring)]);
        if (distance >= off[marker]) continue;
        off[marker] = distance;
        const Detection& d = detections_[static_cast<size_t>(spot.detection)];
        seen[marker] = {true, d.center_px, d.sigma_px};
      }
    }
    const auto count = std::count_if(seen.begin(), seen.end(), [](const auto& o) { return o.seen; });
    if (static_cast<double>(count) < kMinSeen * model_.markers.count())
      return Refusal("only " + std::to_string(count) + " of " + std::to_string(model_.markers.count()) +
                     " markers found");
    return seen;
  }

  std::optional<int> NearestRing(double log_radius) const {
    const auto& radii = ring_log_radii_;
    size_t best = 0;
    for (size_t i = 1; i < radii.size(); ++i) {
      if (std::abs(radii[i] - log_radius) < std::abs(radii[best] - log_radius)) best = i;
    }
    double spacing = std::numeric_limits<double>::infinity();
    if (best > 0) spacing = std::min(spacing, std::abs(radii[best - 1] - radii[best]));
    if (best + 1 < radii.size()) spacing = std::min(spacing, std::abs(radii[best + 1] - radii[best]));
    if (!(std::abs(radii[best] - log_radius) <= kRingGate * spacing)) return std::nullopt;
    return static_cast<int>(best);
  }

  const LinkModel& model_;
  const CameraModel& camera_;
  const CameraId id_;
  const Detections& detections_;
  std::vector<double> picture_angles_;  // of the paths
  Star star_;
  std::vector<std::vector<Spot>> by_path_;
  std::vector<double> ring_log_radii_;  // counted from the camera's end
};

}  // namespace

Result<std::vector<MarkerObservation>> LabelRestPicture(const LinkModel& model, CameraId id,
                                                        const Detections& detections) {
  return RestLabeller(model, id, detections).Run();
}

Result<LabelledMarkers> LabelRestPair(const LinkModel& model,
                                      const std::array<Detections, kCameraCount>& detections) {
  LabelledMarkers labelled;
  for (const CameraId id : kBothCameras) {
    auto seen = LabelRestPicture(model, id, detections[Index(id)]);
    if (!seen) return seen.error();
    labelled.cameras[Index(id)] = *std::move(seen);
  }
  return labelled;
}

}  // namespace taclink
