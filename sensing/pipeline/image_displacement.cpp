#include "sensing/pipeline/image_displacement.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sensing/camera/camera_fit.h"
#include "sensing/camera/projection.h"
#include "sensing/core/median.h"
#include "sensing/pipeline/reason_text.h"

namespace taclink {
namespace {

using Pixels = std::vector<std::optional<Vec2>>;

constexpr int kTurns = 4;            // that are tried within a pitch of the paths
constexpr int kMostFits = 12;        // of one try
constexpr double kExplainedPx = 3;   // a spot lies within this of its marker
constexpr double kLeastShare = 0.6;  // of spots and of markers, that must be explained
// What is told of it.
constexpr double kLeastShiftPx = 0.5, kLeastTurnRad = 0.005, kLeastScale = 0.005;
// Of the RMS residual without the displacement, that it may leave. A pressed skin leaves more: it is no
// similarity of the image.
constexpr double kMostLeft = 0.5;
// Of displacements that explain the spots, the one is preferred that has the fewest parts, then the smallest
// shift: px of RMS that a part costs (shift, turn, scale, mirror), and a px of shift.
constexpr double kPerPart = 0.4, kPerShift = 0.05;

struct Pair {
  int marker = 0;
  Vec2 spot_px;
};

struct Similarity {
  double cosine = 1, sine = 0;  // times the scale
  bool is_mirrored = false;
  Vec2 shift_px = Vec2::Zero();

  // About the middle.
  Vec2 operator()(const Vec2& p) const {
    const double x = is_mirrored ? -p.x() : p.x();
    return {cosine * x - sine * p.y() + shift_px.x(), sine * x + cosine * p.y() + shift_px.y()};
  }
};

int Parts(const ImageDisplacement& found) {
  return (found.shift_px.norm() > kLeastShiftPx ? 1 : 0) +
         (std::abs(found.turn_rad) > kLeastTurnRad ? 1 : 0) +
         (std::abs(found.scale - 1) > kLeastScale ? 1 : 0) + (found.is_mirrored ? 1 : 0);
}

class DisplacementSearch {
 public:
  DisplacementSearch(const LinkModel& model, const Vec2& middle_px,
                     std::span<const std::optional<Vec2>> expected, const Detections& spots)
      : model_(model), expected_(expected.begin(), expected.end()) {
    for (auto& place : expected_)
      if (place) *place -= middle_px;
    for (const Detection& spot : spots)
      if (!spot.clipped) spots_px_.push_back(spot.center_px - middle_px);
  }

  std::optional<ImageDisplacement> Find() {
    std::optional<ImageDisplacement> best;
    double least = std::numeric_limits<double>::infinity();
    for (int turn = 0; turn < kTurns; ++turn) {
      const std::vector<Pair> pairs = Register(turn * model_.markers.path_pitch_rad() / kTurns);
      if (!IsEnough(pairs.size())) continue;
      for (int path = 0; path < model_.markers.paths; ++path) {
        for (const bool is_mirrored : {false, true}) {
          const auto found = Explain(pairs, path, is_mirrored);
          if (!found) continue;
          const double cost = found->rms_px + kPerPart * Parts(*found) + kPerShift * found->shift_px.norm();
          if (cost >= least) continue;
          least = cost;
          best = found;
        }
      }
    }
    return best;
  }

 private:
  bool IsEnough(size_t pairs) const {
    return static_cast<double>(pairs) >= kLeastShare * static_cast<double>(spots_px_.size()) &&
           static_cast<double>(pairs) >= kLeastShare * 0.5 * model_.markers.count();
  }

  // Of the marker at one place of the grid, where another one of that ring is.
  const std::optional<Vec2>& Expected(int marker, int path, bool is_mirrored) const {
    const int paths = model_.markers.paths, own = model_.PathOf(marker);
    const int other = ((is_mirrored ? -own : own) + path + 2 * paths) % paths;
    return expected_[static_cast<size_t>(model_.MarkerIndex(other, model_.RingOf(marker)))];
  }

  // Least squares of a similarity (Umeyama 1991, in the plane).
  std::optional<Similarity> Fit(const std::vector<Pair>& pairs, int path, bool is_mirrored) const {
    Vec2 from_mean = Vec2::Zero(), to_mean = Vec2::Zero();
    int count = 0;
    for (const Pair& pair : pairs) {
      const auto& from = Expected(pair.marker, path, is_mirrored);
      if (!from) continue;
      from_mean += Vec2(is_mirrored ? -from->x() : from->x(), from->y());
      to_mean += pair.spot_px;
      ++count;
    }
    if (count < 8) return std::nullopt;
    from_mean /= count;
    to_mean /= count;
    double dot = 0, cross = 0, squares = 0;
    for (const Pair& pair : pairs) {
      const auto& from = Expected(pair.marker, path, is_mirrored);
      if (!from) continue;
      const Vec2 a = Vec2(is_mirrored ? -from->x() : from->x(), from->y()) - from_mean,
                 b = pair.spot_px - to_mean;
      dot += a.dot(b);
      cross += a.x() * b.y() - a.y() * b.x();
      squares += a.squaredNorm();
    }
    if (squares <= 0) return std::nullopt;
    Similarity fit{.cosine = dot / squares, .sine = cross / squares, .is_mirrored = is_mirrored};
    fit.shift_px = to_mean - Vec2(fit.cosine * from_mean.x() - fit.sine * from_mean.y(),
                                  fit.sine * from_mean.x() + fit.cosine * from_mean.y());
    return fit;
  }

  // Iterative closest points from a turn, the pattern's middle on the spots'.
  std::vector<Pair> Register(double turn_rad) const {
    const double scale = std::clamp(MeanRadius(spots_px_) / MeanRadius(ExpectedPlaces()), 0.8, 1.25);
    Similarity at{.cosine = scale * std::cos(turn_rad), .sine = scale * std::sin(turn_rad)};
    at.shift_px = Middle(spots_px_) - at(Middle(ExpectedPlaces()));
    std::vector<Pair> pairs;
    double gate_px = 12;
    for (int fit = 0; fit < kMostFits; ++fit) {
      pairs = Nearest(at, gate_px);
      const auto next = Fit(pairs, 0, false);
      if (!next) return {};
      at = *next;
      gate_px = std::max(kExplainedPx, 0.8 * gate_px);
    }
    return Nearest(at, kExplainedPx);
  }

  static Vec2 Middle(const std::vector<Vec2>& points) {
    std::vector<double> x, y;
    for (const Vec2& point : points) x.push_back(point.x()), y.push_back(point.y());
    return {Median(x), Median(y)};
  }
  static double MeanRadius(const std::vector<Vec2>& points) {
    const Vec2 middle = Middle(points);
    double sum = 0;
    for (const Vec2& point : points) sum += (point - middle).norm();
    return sum / std::max<double>(1, static_cast<double>(points.size()));
  }
  std::vector<Vec2> ExpectedPlaces() const {
    std::vector<Vec2> places;
    for (const auto& place : expected_)
      if (place) places.push_back(*place);
    return places;
  }

  std::vector<Pair> Nearest(const Similarity& at, double gate_px) const {
    std::vector<Vec2> places(expected_.size());
    for (size_t m = 0; m < places.size(); ++m)
      places[m] = expected_[m] ? at(*expected_[m]) : Vec2::Constant(std::numeric_limits<double>::infinity());
    std::vector<Pair> pairs;
    for (const Vec2& spot : spots_px_) {
      const auto nearest = std::ranges::min_element(
          places, {}, [&](const Vec2& place) { return (place - spot).squaredNorm(); });
      if ((*nearest - spot).norm() < gate_px)
        pairs.push_back({static_cast<int>(nearest - places.begin()), spot});
    }
    return pairs;
  }

  std::optional<ImageDisplacement> Explain(const std::vector<Pair>& pairs, int path, bool is_mirrored) const {
    const auto fit = Fit(pairs, path, is_mirrored);
    if (!fit) return std::nullopt;
    ImageDisplacement found{.shift_px = fit->shift_px,
                            .turn_rad = std::atan2(fit->sine, fit->cosine),
                            .scale = std::hypot(fit->cosine, fit->sine),
                            .is_mirrored = is_mirrored};
    double squares = 0, squares_without = 0;
    for (const Pair& pair : pairs) {
      const auto& from = Expected(pair.marker, path, is_mirrored);
      if (!from) continue;
      const double off_px2 = ((*fit)(*from) - pair.spot_px).squaredNorm();
      if (off_px2 > kExplainedPx * kExplainedPx) continue;
      squares += off_px2;
      squares_without += (*from - pair.spot_px).squaredNorm();
      ++found.spots;
    }
    if (!IsEnough(static_cast<size_t>(found.spots))) return std::nullopt;
    found.rms_px = std::sqrt(squares / (2.0 * found.spots));
    found.rms_without_px = std::sqrt(squares_without / (2.0 * found.spots));
    return found;
  }

  const LinkModel& model_;
  Pixels expected_;
  std::vector<Vec2> spots_px_;
};

Pixels ExpectedPixels(const LinkModel& model, const CameraModel& camera, std::span<const Vec3> skin_mm) {
  const Projector projector(camera);
  const RestShape rest(model);
  Pixels expected;
  for (int m = 0; m < model.markers.count(); ++m) {
    const Vec3 look = SeenPoint(rest, m, projector.center_in_link(), true) - model.RestMarker(m);
    auto pixel = projector.Project(skin_mm[static_cast<size_t>(m)] + look);
    const bool is_inside = pixel && pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() < camera.width_px &&
                           pixel->y() < camera.height_px;
    expected.push_back(is_inside ? pixel : std::nullopt);
  }
  return expected;
}

// Spots that lie where a marker is expected.
int Explained(const Pixels& expected_px, const Detections& spots, double within_px) {
  return static_cast<int>(std::ranges::count_if(spots, [&](const Detection& spot) {
    return std::ranges::any_of(expected_px, [&](const std::optional<Vec2>& place) {
      return place && (*place - spot.center_px).norm() < within_px;
    });
  }));
}

// Of the image of the skin's middle marker.
double PixelsPerMm(const LinkModel& model, const CameraModel& camera) {
  std::vector<double> all;
  const Projector projector(camera);
  for (int m = 0; m < model.markers.count(); ++m)
    if (const auto seen = projector.ProjectWithJacobian(model.RestMarker(m)))
      all.push_back(std::sqrt(seen->jacobian.squaredNorm() / 2));
  return all.empty() ? 1 : Median(all);
}

std::string Text(const ImageDisplacement& found, double px_per_mm) {
  std::string text;
  const auto add = [&](const std::string& what) { text += (text.empty() ? "" : " and ") + what; };
  if (found.is_mirrored) add("mirrored");
  if (std::abs(found.turn_rad) > kLeastTurnRad)
    add(ReasonText("turned by %.1f degrees", std::abs(DegFromRad(found.turn_rad))));
  if (std::abs(found.scale - 1) > kLeastScale)
    add(ReasonText("%.1f %% %s", 100 * std::abs(found.scale - 1), found.scale > 1 ? "larger" : "smaller"));
  if (found.shift_px.norm() > kLeastShiftPx)
    add(ReasonText("shifted by %.1f, %.1f px (%.1f mm of the skin)", found.shift_px.x(), found.shift_px.y(),
                   found.shift_px.norm() / px_per_mm));
  return text;
}

}  // namespace

std::optional<ImageDisplacement> FindDisplacement(const LinkModel& model, int width_px, int height_px,
                                                  std::span<const std::optional<Vec2>> expected_px,
                                                  const Detections& spots) {
  const Vec2 middle_px(0.5 * (width_px - 1), 0.5 * (height_px - 1));
  return DisplacementSearch(model, middle_px, expected_px, spots).Find();
}

std::optional<Reason> DiagnoseImages(const LinkModel& model, const StereoRig& rig,
                                     std::span<const Vec3> skin_mm,
                                     const std::array<Detections, kCameraCount>& spots) {
  std::array<Pixels, kCameraCount> expected;
  for (const CameraId id : kBothCameras) expected[Index(id)] = ExpectedPixels(model, rig[id], skin_mm);
  int as_given = 0, swapped = 0, all = 0;
  for (size_t i = 0; i < kCameraCount; ++i) {
    as_given += Explained(expected[i], spots[i], kExplainedPx);
    swapped += Explained(expected[1 - i], spots[i], kExplainedPx);
    all += static_cast<int>(spots[i].size());
  }
  if (swapped > kLeastShare * all && swapped > 1.5 * as_given)
    return Reason{ReasonId::kCamerasSwapped,
                  "the top camera's images are those of the bottom camera, and the other way round; exchange "
                  "their cables, or the devices in the configuration"};
  std::string text;
  for (const CameraId id : kBothCameras) {
    const CameraModel& camera = rig[id];
    const auto found =
        FindDisplacement(model, camera.width_px, camera.height_px, expected[Index(id)], spots[Index(id)]);
    if (!found || Parts(*found) == 0) continue;
    if (found->rms_px > kMostLeft * found->rms_without_px) continue;
    text += (text.empty() ? "" : "; ") + ReasonText("the %s camera's image is %s", Name(id),
                                                    Text(*found, PixelsPerMm(model, camera)).c_str());
  }
  if (text.empty()) return std::nullopt;
  return Reason{
      ReasonId::kCamerasMoved,
      text +
          " against its calibration: the camera has moved or is another link's, or its driver turns, "
          "mirrors or crops the image; put that right, or calibrate again"};
}

}  // namespace taclink
