#include "sensing/pipeline/rest_match.h"

#include <algorithm>
#include <limits>

#include "sensing/camera/camera_fit.h"
#include "sensing/camera/projection.h"

namespace taclink {
namespace {

constexpr double kGate = 1.0 / 3;  // of the way to the nearest neighbour
constexpr double kMovedGate = 1;   // the same, for what is left
// Of the spacing of the far ring's markers. Nearer spots that fail the gate are badly seen ones of that ring.
constexpr double kLeastMoved = 2.0 / 3;
constexpr int kMaxTurns = 5;
// So many markers more must be explained by a camera that is off the nominal one by sqrt(2) tolerances more.
constexpr double kMarkersPerDeparture = 4;
constexpr double kMissing = 0.1;            // a ring or path is missing if no larger part of it is seen
constexpr double kMostLostPaths = 1.0 / 6;  // paths whose markers may have broken off; a model has others
constexpr double kMaxUnexplained = 0.6;     // of a ring's number of markers, in one picture
constexpr double kRingWidth = 0.08;  // of a ring's radius in the picture: cameras sit a little off the axis

// The nearest of `points` to p, and its distance; -1: there is none.
std::pair<int, double> Nearest(const std::vector<std::optional<Vec2>>& points, const Vec2& p,
                               int except = -1) {
  std::pair<int, double> best{-1, std::numeric_limits<double>::infinity()};
  for (size_t i = 0; i < points.size(); ++i) {
    const auto& point = points[i];
    if (!point || static_cast<int>(i) == except) continue;
    const double distance = (*point - p).norm();
    if (distance < best.second) best = {static_cast<int>(i), distance};
  }
  return best;
}

// Spots and markers that are left and each other's nearest of those: where the skin is touched. They are
// outliers of a fit, but say where and how deep.
void MatchMoved(const Detections& detections, std::vector<std::optional<Vec2>> expected,
                std::vector<bool>& taken, std::vector<MarkerObservation>& markers) {
  std::vector<std::optional<Vec2>> spots(detections.size());
  const auto all = expected;
  for (size_t k = 0; k < detections.size(); ++k) {
    if (!taken[k] && !detections[k].clipped) spots[k] = detections[k].center_px;
  }
  for (size_t m = 0; m < markers.size(); ++m) {
    if (markers[m].seen) expected[m].reset();
  }
  double spacing_px = std::numeric_limits<double>::infinity();
  for (size_t m = 0; m < all.size(); ++m)
    if (all[m]) spacing_px = std::min(spacing_px, Nearest(all, *all[m], static_cast<int>(m)).second);
  for (size_t k = 0; k < detections.size(); ++k) {
    const auto& spot = spots[k];
    if (!spot) continue;
    const auto [marker, distance] = Nearest(expected, *spot);
    if (marker < 0) continue;
    const Vec2 place = expected[static_cast<size_t>(marker)].value_or(*spot);
    if (distance < kLeastMoved * spacing_px || distance > kMovedGate * Nearest(all, place, marker).second)
      continue;
    if (Nearest(spots, place).first != static_cast<int>(k)) continue;
    markers[static_cast<size_t>(marker)] = {true, detections[k].center_px, detections[k].covariance_px2};
    taken[k] = true;
  }
}

// The most values within a band of kRingWidth.
int MostAlike(std::vector<double>& values) {
  std::sort(values.begin(), values.end());
  size_t most = 0, first = 0;
  for (size_t last = 0; last < values.size(); ++last) {
    while (values[first] < (1 - kRingWidth) * values[last]) ++first;
    most = std::max(most, last - first + 1);
  }
  return static_cast<int>(most);
}

// Rings or paths of which a picture shows next to nothing, counted from 1.
std::vector<int> Missing(const LinkModel& model, const RestMatch& match, bool rings) {
  std::vector<int> seen(static_cast<size_t>(rings ? model.markers.rings() : model.markers.paths), 0);
  for (int m = 0; m < model.markers.count(); ++m) {
    if (match.markers[static_cast<size_t>(m)].seen)
      ++seen[static_cast<size_t>(rings ? model.RingOf(m) : model.PathOf(m))];
  }
  const int full = rings ? model.markers.paths : model.markers.rings();
  std::vector<int> missing;
  for (size_t i = 0; i < seen.size(); ++i) {
    if (seen[i] <= kMissing * full) missing.push_back(static_cast<int>(i) + 1);
  }
  return missing;
}

// The labels, if all of them were wrong by so many rings.
std::vector<MarkerObservation> Shifted(const LinkModel& model, std::span<const MarkerObservation> labels,
                                       int rings) {
  std::vector<MarkerObservation> shifted(labels.size());
  for (int m = 0; m < model.markers.count(); ++m) {
    const int ring = model.RingOf(m) + rings;
    if (ring < 0 || ring >= model.markers.rings()) continue;
    shifted[static_cast<size_t>(model.MarkerIndex(model.PathOf(m), ring))] = labels[static_cast<size_t>(m)];
  }
  return shifted;
}

bool SameLabels(const std::vector<MarkerObservation>& a, const std::vector<MarkerObservation>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), [](const auto& one, const auto& other) {
    return one.seen == other.seen && one.center_px == other.center_px;
  });
}

std::optional<SettledCamera> SettleFrom(const RestShape& shape, CameraId id,
                                        std::vector<MarkerObservation> labels, const Detections& detections,
                                        bool domes) {
  const LinkModel& model = shape.model();
  const CameraFitOptions options{{}, model.nominal_rig[id].lens.kind, domes};
  std::optional<SettledCamera> settled;
  for (int turn = 0; turn < kMaxTurns; ++turn) {
    if (CountUsable(labels) < model.markers.count() / 4) return std::nullopt;
    const auto fit = FitCamera(shape, id, labels, options);
    if (!fit) return settled;
    settled = {.camera = fit->camera,
               .match = MatchRestPicture(shape, fit->camera, detections, domes),
               .score = 0,
               .misfit = fit->misfit};
    settled->score = CountUsable(settled->match.markers) - kMarkersPerDeparture * fit->bundle.tolerance_cost;
    if (SameLabels(labels, settled->match.markers)) break;
    labels = settled->match.markers;
  }
  return settled;
}

}  // namespace

RestMatch MatchRestPicture(const RestShape& shape, const CameraModel& camera, const Detections& detections,
                           bool domes, bool with_moved) {
  const LinkModel& model = shape.model();
  RestMatch match;
  match.markers.resize(static_cast<size_t>(model.markers.count()));
  const Projector projector(camera);
  std::vector<std::optional<Vec2>> expected, spots;
  for (int m = 0; m < model.markers.count(); ++m)
    expected.push_back(projector.Project(SeenPoint(shape, m, projector.center_in_link(), domes)));
  for (const Detection& d : detections) spots.emplace_back(d.center_px);
  std::vector<bool> taken(detections.size(), false);
  for (size_t k = 0; k < detections.size(); ++k) {
    const Detection& d = detections[k];
    const auto [marker, distance] = Nearest(expected, d.center_px);
    if (marker < 0) continue;
    const Vec2 place = expected[static_cast<size_t>(marker)].value_or(d.center_px);
    const double room = Nearest(expected, place, marker).second;
    if (distance <= kGate * room && Nearest(spots, place).first == static_cast<int>(k)) {
      if (!d.clipped) match.markers[static_cast<size_t>(marker)] = {true, d.center_px, d.covariance_px2};
      taken[k] = true;
    }
  }
  if (with_moved) MatchMoved(detections, expected, taken, match.markers);
  std::vector<double> radii;
  for (size_t k = 0; k < detections.size(); ++k) {
    if (!taken[k] && !detections[k].clipped)
      radii.push_back((detections[k].center_px - camera.lens.principal_point_px).norm());
  }
  match.unexplained = MostAlike(radii);
  return match;
}

std::optional<SettledCamera> SettleCamera(const RestShape& shape, CameraId id,
                                          std::span<const MarkerObservation> labels,
                                          const Detections& detections, bool domes) {
  std::optional<SettledCamera> best;
  for (const int rings : {0, -1, 1}) {
    auto settled = SettleFrom(shape, id, Shifted(shape.model(), labels, rings), detections, domes);
    if (settled && (!best || settled->score > best->score)) best = std::move(settled);
  }
  return best;
}

std::string GridTrouble(const LinkModel& model, const std::array<RestMatch, kCameraCount>& matches) {
  for (const bool rings : {true, false}) {
    const auto top = Missing(model, matches[0], rings), bottom = Missing(model, matches[1], rings);
    // A picture may lose the far ring to the dark; both losing theirs shows a link with fewer rings.
    const bool both = std::any_of(top.begin(), top.end(), [&](int one) {
      return std::find(bottom.begin(), bottom.end(), one) != bottom.end();
    });
    if (!both && (!rings || top.empty() || bottom.empty())) continue;
    const size_t most = std::max(top.size(), bottom.size());
    if (!rings && static_cast<double>(most) <= kMostLostPaths * model.markers.paths) continue;
    return std::string("the pictures do not show the model's ") + (rings ? "ring " : "path ") +
           std::to_string(top.front());
  }
  const int unexplained = std::max(matches[0].unexplained, matches[1].unexplained);
  if (unexplained > kMaxUnexplained * model.markers.paths) {
    return "the pictures show " + std::to_string(unexplained) + " spots on a ring where the model has none";
  }
  return {};
}

}  // namespace taclink
