#include "sensing/markers/rest_labels.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <limits>
#include <optional>
#include <string>

#include "sensing/camera/projection.h"

namespace taclink {
namespace {

constexpr double kSearchHalfWidth = 64, kSearchStep = 4;  // px around the nominal principal point
constexpr double kMinCoherence = 0.55;                    // of the path angles; 1: all on lines, 0: none
constexpr double kSector = 0.25;                          // path pitches off a line
constexpr double kRingGate = 0.4;                         // of the distance to the next ring
constexpr double kMinSeen = 0.5;                          // of all markers
constexpr double kMaxShift = 0.3, kMaxStretch = 0.2;      // log radius against the nominal lens
constexpr double kMinOnRings = 0.5;                       // of the spots on paths

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

  // All rings together: the nominal log radii, shifted (scale) and stretched (lens) so that most spots lie on
  // one; then every ring's own median. No single path needs to be complete for that.
  Result<void> FindRings() {
    const std::vector<double> nominal = NominalLogRadii();
    size_t seen_by_lens = 0;
    double middle = 0;
    for (const double r : nominal) {
      if (!std::isnan(r)) middle += r, ++seen_by_lens;
    }
    if (seen_by_lens < nominal.size()) return Refusal("the model's nominal lens does not see all rings");
    middle /= static_cast<double>(seen_by_lens);
    double best = 0;
    std::vector<double> radii(nominal.size());
    for (double stretch = -kMaxStretch; stretch <= kMaxStretch; stretch += 0.02) {
      for (double shift = -kMaxShift; shift <= kMaxShift; shift += 0.01) {
        for (size_t i = 0; i < radii.size(); ++i) {
          radii[i] = middle + shift + (1 + stretch) * (nominal[i] - middle);
        }
        // The nominal lens counts a little: else a shift by a whole ring might do.
        const double score = Score(radii) * (1 - 0.1 * std::abs(shift) - 0.1 * std::abs(stretch));
        if (score > best) best = score, ring_log_radii_ = radii;
      }
    }
    if (best < kMinOnRings) return Refusal("the rings' distances do not fit the model");
    for (int round = 0; round < 3; ++round) CenterRings();
    return {};
  }

  // Part of the spots that lie on rings; the nearer the more.
  double Score(const std::vector<double>& radii) const {
    double sum = 0;
    int count = 0;
    for (const auto& path : by_path_) {
      for (const Spot& spot : path) {
        const RingPlace place = PlaceAmong(radii, spot.log_radius);
        const double off = place.off / (0.3 * place.spacing);
        sum += std::max(0.0, 1 - off * off);
        ++count;
      }
    }
    return sum / std::max(1, count);
  }

  void CenterRings() {
    std::vector<std::vector<double>> on_ring(ring_log_radii_.size());
    for (const auto& path : by_path_) {
      for (const Spot& spot : path) {
        if (const auto ring = NearestRing(spot.log_radius))
          on_ring[static_cast<size_t>(*ring)].push_back(spot.log_radius);
      }
    }
    for (size_t i = 0; i < on_ring.size(); ++i) {
      if (on_ring[i].size() < 3) continue;
      const auto middle = on_ring[i].begin() + static_cast<long>(on_ring[i].size() / 2);
      std::nth_element(on_ring[i].begin(), middle, on_ring[i].end());
      ring_log_radii_[i] = *middle;
    }
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
        seen[marker] = {true, d.center_px, d.covariance_px2};
      }
    }
    const auto count = std::count_if(seen.begin(), seen.end(), [](const auto& o) { return o.seen; });
    if (static_cast<double>(count) < kMinSeen * model_.markers.count())
      return Refusal("only " + std::to_string(count) + " of " + std::to_string(model_.markers.count()) +
                     " markers found");
    return seen;
  }

  struct RingPlace {
    size_t ring;
    double off, spacing;  // log radius; spacing to the nearer neighbour
  };
  // `radii` fall; the ring nearest to a spot.
  static RingPlace PlaceAmong(const std::vector<double>& radii, double log_radius) {
    const auto after = std::lower_bound(radii.begin(), radii.end(), log_radius, std::greater<>());
    auto best = static_cast<size_t>(after - radii.begin());
    if (best == radii.size() || (best > 0 && radii[best - 1] - log_radius < log_radius - radii[best])) --best;
    double spacing = std::numeric_limits<double>::infinity();
    if (best > 0) spacing = std::min(spacing, radii[best - 1] - radii[best]);
    if (best + 1 < radii.size()) spacing = std::min(spacing, radii[best] - radii[best + 1]);
    return {best, std::abs(radii[best] - log_radius), spacing};
  }
  std::optional<int> NearestRing(double log_radius) const {
    const RingPlace place = PlaceAmong(ring_log_radii_, log_radius);
    if (!(place.off <= kRingGate * place.spacing)) return std::nullopt;
    return static_cast<int>(place.ring);
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
