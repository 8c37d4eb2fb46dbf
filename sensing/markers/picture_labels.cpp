#include "sensing/markers/picture_labels.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "sensing/markers/chain_alignment.h"
#include "sensing/markers/marker_search.h"

namespace taclink {
namespace {

constexpr double kSector = 0.4;         // path pitches off a line
constexpr double kSigmaOffPath = 0.12;  // path pitches
constexpr double kSigmaLogArea = 0.7;
constexpr double kMissingCost = 5, kMissingOutsideCost = 0.5;  // a ring is not seen; is outside the picture
constexpr double kMinMargin = 3;                               // to the second best alignment
constexpr double kMaxOutwardMm = 15;
// What is pushed goes inwards: outwards the skin moves only as a whole, which the grid's rings take up, and a
// little beside a dent. Neighbouring spots err alike, so that each counts for less than one.
constexpr double kFreeOutwardMm = 2, kSigmaOutwardMm = 1.5, kMaxOutwardCost = 2;
constexpr double kSpotWeight = 0.4;
// Displacements of neighbouring paths, in what the next ring's label would be off.
constexpr double kAgreeing = 0.35, kAgreeingOneSided = 0.25, kSpread = 0.5;
constexpr double kInDentMm = 1.5;
// A dent that goes deeper than the neighbours by more than this (mm and times) is none.
constexpr double kMaxBeyondMm = 3, kMaxBeyondTimes = 3, kMaxOutwardBeyondMm = 2;
// The neighbours' displacement as a prior. Its standard deviation grows with what they have beyond kAtRestMm.
constexpr double kSigmaRestMm = 0.7, kAtRestMm = 1.2, kSigmaPart = 2, kMaxPriorCost = 8;
constexpr double kSigmaOneSidedMm = 0.5, kMaxRestMm = 3;
constexpr int kMaxRounds = 12;
// Looking again: off the predicted place in gaps to the next ring, size and contrast against the neighbours.
constexpr double kMaxOffPlace = 0.3, kMaxAreaRatio = 2.2, kMinContrastPart = 0.2, kMinContrast = 6;
constexpr double kWideGap = 1.5, kNarrowGap = 0.5;  // between spots, in the rings' spacing at rest
constexpr double kMinOfRing = 0.15;  // part of a ring's or a path's markers without which it is none
constexpr double kMinSeen = 0.5;     // of all markers

double Median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<long>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

class PictureLabeller {
 public:
  PictureLabeller(const LinkModel& model, CameraId id, const Detections& detections, const cv::Mat& gray,
                  PictureGrid grid)
      : model_(model),
        id_(id),
        camera_(model.nominal_rig[id]),
        detections_(detections),
        given_(detections.size()),
        gray_(gray),
        grid_(std::move(grid)),
        paths_(model.markers.paths),
        rings_(model.markers.rings()) {
    cells_.resize(static_cast<size_t>(paths_ * rings_));
    const double sign = id == CameraId::kTop ? 1 : -1, origin = id == CameraId::kTop ? 0 : model.length_mm;
    for (int j = 0; j < rings_; ++j) {
      along_mm_.push_back(sign * (model.RestMarker(MarkerAt(0, j)).z() - origin));
    }
  }

  Result<PictureLabels> Run() {
    SortIntoPaths();
    LearnAreas();
    for (int l = 0; !gray_.empty() && l < paths_; ++l) FillChain(l);
    for (int round = 0, before = -1; round < kMaxRounds && before != labelled_; ++round) {
      before = labelled_;
      LearnAreas();
      for (int l = 0; l < paths_; ++l) AlignPath(l);
      TakeLabels();
    }
    DropUnsure();
    if (!gray_.empty()) {
      for (int round = 0; round < 3; ++round) LookAgain();
    }
    if (auto checked = CheckComplete(); !checked) return checked.error();
    return Labels();
  }

 private:
  struct Spot {
    int detection = 0;
    double off_path = 0, log_radius = 0, tan = 0;
    int ring = -1;
  };
  struct Cell {  // of the grid; rings from the camera's end
    std::optional<Detection> detection;
    double off_path = 0, log_radius = 0, displacement_mm = 0;  // inwards
    bool looked_again = false;
  };

  int MarkerAt(int path, int ring_from_near) const {
    return model_.MarkerIndex(path, id_ == CameraId::kTop ? ring_from_near : rings_ - 1 - ring_from_near);
  }
  Cell& At(int path, int ring) {
    return cells_[static_cast<size_t>((path + paths_) % paths_ * rings_ + ring)];
  }
  bool Has(int path, int ring) { return ring >= 0 && ring < rings_ && At(path, ring).detection; }
  double DisplacementOf(double tan, int ring) const {
    return grid_.ring_radius_mm(ring) - grid_.ring_distance_mm(ring) * tan;
  }
  bool Possible(double displacement_mm, int ring) const {
    return displacement_mm > -kMaxOutwardMm &&
           grid_.ring_radius_mm(ring) - displacement_mm > model_.tube_outer_radius_mm - 1;
  }
  bool Inside(const Vec2& p, double margin) const {
    return p.x() > margin && p.y() > margin && p.x() < camera_.width_px - margin &&
           p.y() < camera_.height_px - margin;
  }

  void SortIntoPaths() {
    spots_.resize(static_cast<size_t>(paths_));
    for (size_t i = 0; i < detections_.size(); ++i) {
      const auto place = grid_.PlaceOf(detections_[i].center_px);
      if (std::abs(place.off_path) > kSector) continue;
      spots_[static_cast<size_t>(place.path)].push_back(
          {static_cast<int>(i), place.off_path, place.log_radius, grid_.TanAt(place.log_radius), -1});
    }
    for (auto& path : spots_) {
      std::sort(path.begin(), path.end(),
                [](const Spot& a, const Spot& b) { return a.log_radius > b.log_radius; });
    }
  }

  double SpacingAt(double log_radius) const {
    const auto j = static_cast<size_t>(NearestRing(log_radius));
    const auto& radii = grid_.ring_log_radii();
    const size_t next = std::min(j + 1, radii.size() - 1), before = j > 0 ? j - 1 : 0;
    return (radii[before] - radii[next]) / static_cast<double>(next - before);
  }
  int NearestRing(double log_radius) const {
    const auto& radii = grid_.ring_log_radii();
    const auto nearest = std::min_element(radii.begin(), radii.end(), [&](double a, double b) {
      return std::abs(a - log_radius) < std::abs(b - log_radius);
    });
    return static_cast<int>(nearest - radii.begin());
  }

  // Dim markers in the gaps of a path and beyond its last spot: alignment is sure where it can count.
  void FillChain(int path) {
    auto& spots = spots_[static_cast<size_t>(path)];
    const double end = grid_.ring_log_radii().back() - 0.4 * SpacingAt(grid_.ring_log_radii().back());
    for (size_t k = 0; k < spots.size(); ++k) {
      if (spots.size() > static_cast<size_t>(2 * rings_)) return;
      const double spacing = SpacingAt(spots[k].log_radius);
      const bool last = k + 1 == spots.size();
      const double at = spots[k].log_radius - spacing;
      if (last ? at < end : spots[k].log_radius - spots[k + 1].log_radius < kWideGap * spacing) continue;
      Cell cell;
      cell.off_path = spots[k].off_path;
      cell.log_radius = last ? at : std::max(at, 0.5 * (spots[k].log_radius + spots[k + 1].log_radius));
      if (std::abs(cell.off_path) > kSector / 2) continue;
      MarkerPlace place = PlaceFor(path, NearestRing(cell.log_radius), cell);
      const Cell here{{}, cell.off_path, spots[k].log_radius, 0, false};
      const auto beside = FindMarkerAt(gray_, PlaceFor(path, NearestRing(here.log_radius), here), 0);
      const double least = std::max(kMinContrast, kMinContrastPart * (beside ? beside->contrast : 0));
      const auto found = FindMarkerAt(gray_, place, least);
      if (!found || !SizeFits(found->detection, NearestRing(cell.log_radius))) continue;
      const auto where = grid_.PlaceOf(found->detection.center_px);
      const bool in_gap = where.log_radius < spots[k].log_radius - kNarrowGap * spacing &&
                          (last || where.log_radius > spots[k + 1].log_radius + kNarrowGap * spacing);
      if (where.path != path || std::abs(where.off_path - cell.off_path) > kSector / 2 || !in_gap) continue;
      detections_.push_back(found->detection);
      spots.insert(spots.begin() + static_cast<long>(k) + 1,
                   {static_cast<int>(detections_.size()) - 1, where.off_path, where.log_radius,
                    grid_.TanAt(where.log_radius), -1});
    }
  }
  bool SizeFits(const Detection& d, int ring) const {
    const double ratio = d.area_px2 / std::exp(log_areas_[static_cast<size_t>(ring)]);
    return ratio < kMaxAreaRatio && (d.clipped || ratio > 1 / kMaxAreaRatio);
  }

  // By ring, of what is labelled; before, of what lies nearest to it.
  void LearnAreas() {
    std::vector<std::vector<double>> areas(static_cast<size_t>(rings_));
    for (const auto& path : spots_) {
      for (const Spot& spot : path) {
        const Detection& d = detections_[static_cast<size_t>(spot.detection)];
        int ring = spot.ring;
        if (labelled_ == 0) ring = NearestRing(spot.log_radius);
        if (ring >= 0 && !d.clipped) areas[static_cast<size_t>(ring)].push_back(std::log(d.area_px2));
      }
    }
    log_areas_.resize(static_cast<size_t>(rings_), 0);
    for (size_t j = 0; j < areas.size(); ++j) {
      if (!areas[j].empty()) log_areas_[j] = Median(areas[j]);
    }
  }

  struct Expected {
    double displacement_mm = 0, sigma_mm = 0;
  };
  // From the neighbouring paths. None: nothing is known of them, or they are deformed.
  std::optional<Expected> FromNeighbours(int path, int ring) {
    double sum = 0, largest = 0;
    int sides = 0;
    for (const int side : {-1, 1}) {
      if (!Has(path + side, ring)) continue;
      sum += At(path + side, ring).displacement_mm;
      ++sides;
      for (const int j : {ring - 1, ring, ring + 1}) {
        if (Has(path + side, j)) largest = std::max(largest, std::abs(At(path + side, j).displacement_mm));
      }
    }
    if (sides == 0 || largest > kMaxRestMm) return std::nullopt;  // in a dent only counting is sure
    return Expected{sum / sides, kSigmaRestMm + kSigmaPart * std::max(0.0, largest - kAtRestMm) +
                                     (sides == 1 ? kSigmaOneSidedMm : 0)};
  }

  double CostOf(const Spot& spot, int ring, double displacement_mm, const std::optional<Expected>& expected) {
    const Detection& d = detections_[static_cast<size_t>(spot.detection)];
    double cost = std::pow(spot.off_path / kSigmaOffPath, 2);
    if (!d.clipped) {
      const double off = (std::log(d.area_px2) - log_areas_[static_cast<size_t>(ring)]) / kSigmaLogArea;
      cost += std::min(off * off, 6.0);
    }
    const double outward = std::max(0.0, -displacement_mm - kFreeOutwardMm) / kSigmaOutwardMm;
    cost += kSpotWeight * std::min(outward * outward, kMaxOutwardCost);
    if (expected) {
      const double off = (displacement_mm - expected->displacement_mm) / expected->sigma_mm;
      cost += kSpotWeight * std::min(off * off, kMaxPriorCost);
    }
    return cost;
  }

  void AlignPath(int path) {
    auto& spots = spots_[static_cast<size_t>(path)];
    std::vector<double> missing;
    for (int j = 0; j < rings_; ++j) {
      const Vec2 p = grid_.PixelOf(path, 0, grid_.ring_log_radii()[static_cast<size_t>(j)]);
      const double size = std::exp(0.5 * log_areas_[static_cast<size_t>(j)]);
      missing.push_back(Inside(p, 0.5 * size) ? kMissingCost : kMissingOutsideCost);
    }
    alignment_.Start(static_cast<int>(spots.size()), along_mm_, model_.length_mm, missing);
    for (int j = 0; j < rings_; ++j) {
      const auto expected = FromNeighbours(path, j);
      for (size_t k = 0; k < spots.size(); ++k) {
        const double displacement = DisplacementOf(spots[k].tan, j);
        if (!Possible(displacement, j)) continue;
        alignment_.Allow(static_cast<int>(k), j, CostOf(spots[k], j, displacement, expected), displacement);
      }
    }
    alignment_.Solve();
    for (size_t k = 0; k < spots.size(); ++k) {
      const bool sure = alignment_.MarginOf(static_cast<int>(k)) >= kMinMargin;
      spots[k].ring = sure ? alignment_.RingOf(static_cast<int>(k)) : -1;
    }
  }

  // All paths at once, so that their order does not matter.
  void TakeLabels() {
    for (Cell& cell : cells_) cell = {};
    for (int l = 0; l < paths_; ++l) {
      for (const Spot& spot : spots_[static_cast<size_t>(l)]) {
        if (spot.ring < 0) continue;
        At(l, spot.ring) = {detections_[static_cast<size_t>(spot.detection)], spot.off_path, spot.log_radius,
                            DisplacementOf(spot.tan, spot.ring),
                            static_cast<size_t>(spot.detection) >= given_};
      }
    }
    DropImplausible();
    labelled_ = 0;
    for (const Cell& cell : cells_) labelled_ += cell.detection ? 1 : 0;
  }

  // Skin is continuous: what both neighbouring paths say bounds what is between them.
  void DropImplausible() {
    std::vector<size_t> dropped;
    for (int l = 0; l < paths_; ++l) {
      for (int j = 0; j < rings_; ++j) {
        if (!Has(l, j) || !Has(l - 1, j) || !Has(l + 1, j)) continue;
        const double u = At(l, j).displacement_mm;
        const double a = At(l - 1, j).displacement_mm, b = At(l + 1, j).displacement_mm;
        const bool in = u > kMaxBeyondMm + kMaxBeyondTimes * std::max({a, b, 0.0});
        const bool out = u < std::min({a, b, 0.0}) - kMaxOutwardBeyondMm;
        if (in || out) dropped.push_back(static_cast<size_t>(l * rings_ + j));
      }
    }
    for (const size_t index : dropped) cells_[index] = {};
  }

  // By how much the displacement would be off with the next ring's label.
  double PitchMm(int ring) const {
    const int next = ring + 1 < rings_ ? ring + 1 : ring - 1;
    const auto j = static_cast<size_t>(ring), k = static_cast<size_t>(next);
    return grid_.ring_radius_mm(ring) * std::abs(along_mm_[k] - along_mm_[j]) / grid_.ring_distance_mm(ring);
  }

  // Counting from the rim is sure up to the first ring that is missing, spot that is left over, or spot that
  // only the search along the path found; but where that is cannot be told within a dent.
  void CountFromRim(int path, std::vector<bool>& sure) {
    const auto& spots = spots_[static_cast<size_t>(path)];
    int counted = 0;
    for (const Spot& spot : spots) {
      const bool found_later = static_cast<size_t>(spot.detection) >= given_;
      if (spot.ring != counted || found_later || !Has(path, counted)) break;
      ++counted;
    }
    if (counted < rings_) {
      while (counted > 0 && std::abs(At(path, counted - 1).displacement_mm) > kInDentMm) --counted;
      counted = std::max(0, counted - 1);
    }
    for (int j = 0; j < counted; ++j) sure[static_cast<size_t>(path * rings_ + j)] = true;
  }

  // What is beyond that has to agree with sure neighbours, to a part of what the next ring's label would be
  // off.
  bool NeighboursAgree(int path, int ring, const std::vector<bool>& sure) {
    const double u = At(path, ring).displacement_mm, pitch = PitchMm(ring);
    double sum = 0, least = 1e9, largest = -1e9;
    int sides = 0;
    for (const int l : {(path + paths_ - 1) % paths_, (path + 1) % paths_}) {
      if (!sure[static_cast<size_t>(l * rings_ + ring)]) continue;
      const double other = At(l, ring).displacement_mm;
      sum += other, ++sides;
      least = std::min(least, other), largest = std::max(largest, other);
    }
    if (std::max(largest, -least) > (sides == 2 ? kMaxRestMm : kAtRestMm)) return false;
    if (sides == 2) return std::abs(u - sum / 2) < kAgreeing * pitch && largest - least < kSpread * pitch;
    return sides == 1 && std::abs(u - sum) < kAgreeingOneSided * pitch;
  }

  void DropUnsure() {
    std::vector<bool> sure(cells_.size(), false);
    for (int l = 0; l < paths_; ++l) CountFromRim(l, sure);
    for (bool more = true; more;) {
      std::vector<size_t> agreed;
      for (int l = 0; l < paths_; ++l) {
        for (int j = 0; j < rings_; ++j) {
          const auto index = static_cast<size_t>(l * rings_ + j);
          if (Has(l, j) && !sure[index] && NeighboursAgree(l, j, sure)) agreed.push_back(index);
        }
      }
      for (const size_t index : agreed) sure[index] = true;
      more = !agreed.empty();
    }
    for (size_t i = 0; i < cells_.size(); ++i) {
      if (!sure[i]) cells_[i] = {};
    }
  }

  // Displacement of an empty place, by the next rings on both sides or one and both neighbouring paths.
  std::optional<Cell> Predict(int path, int ring) {
    const bool near = ring == 0 || Has(path, ring - 1), far = ring + 1 == rings_ || Has(path, ring + 1);
    const bool sides = Has(path - 1, ring) && Has(path + 1, ring);
    const bool any = Has(path, ring - 1) || Has(path, ring + 1);
    if (!any || !((near && far) || (sides && (near || far)))) return std::nullopt;
    Cell cell;
    double sum = 0, weight = 0, largest = 0, least = 1e9;
    const auto add = [&](int l, int j, double w) {
      if (!Has(l, j)) return;
      const double u = At(l, j).displacement_mm;
      sum += w * u, weight += w;
      largest = std::max(largest, u), least = std::min(least, u);
    };
    for (const int step : {-1, 1}) {
      add(path, ring + step, 1);
      add(path + step, ring, 1);
    }
    // Only what is between two labelled rings is sure of its number in a dent; a steep flank is too vague.
    if (!(near && far) && std::max(largest, -least) > kAtRestMm) return std::nullopt;
    if (largest - least > kMaxOutwardMm / 2) return std::nullopt;
    cell.displacement_mm = sum / weight;
    for (const int j : {ring - 1, ring + 1}) {
      if (Has(path, j))
        cell.off_path =
            cell.off_path == 0 ? At(path, j).off_path : 0.5 * (cell.off_path + At(path, j).off_path);
    }
    const double tan = (grid_.ring_radius_mm(ring) - cell.displacement_mm) / grid_.ring_distance_mm(ring);
    cell.log_radius = grid_.LogRadiusAt(tan);
    return cell;
  }

  // Log radius half way to the next place on the path; beyond the ends as far as on the other side.
  double GapTo(int path, int ring, int step, double log_radius) {
    const int next = ring + step;
    const auto& radii = grid_.ring_log_radii();
    if (Has(path, next)) return std::abs(At(path, next).log_radius - log_radius);
    const int other = next < 0 || next >= rings_ ? ring - step : next;
    return std::abs(radii[static_cast<size_t>(other)] - radii[static_cast<size_t>(ring)]);
  }

  void LookAgain() {
    std::vector<std::pair<size_t, Cell>> found;
    for (int l = 0; l < paths_; ++l) {
      for (int j = 0; j < rings_; ++j) {
        if (Has(l, j)) continue;
        if (auto cell = LookAt(l, j)) found.emplace_back(static_cast<size_t>(l * rings_ + j), *cell);
      }
    }
    for (auto& [index, cell] : found) cells_[index] = cell;
  }

  MarkerPlace PlaceFor(int path, int ring, const Cell& cell) {
    const Vec2 center = grid_.PixelOf(path, cell.off_path, cell.log_radius);
    const Vec2 out = grid_.PixelOf(path, cell.off_path, cell.log_radius + 0.01);
    const double radius = (center - grid_.center_px()).norm();
    const double gap =
        radius * std::min(GapTo(path, ring, -1, cell.log_radius), GapTo(path, ring, 1, cell.log_radius));
    const double size = std::exp(0.5 * log_areas_[static_cast<size_t>(ring)]);
    return {center, (out - center).normalized(), 0.65 * gap, 0.5 * size, 0.6 * size};
  }

  // What contrast the neighbours have, found in the same way; the least of them.
  double NeighbourContrast(int path, int ring) {
    double least = 1e9;
    for (const auto& [l, j] :
         {std::pair(path, ring - 1), {path, ring + 1}, {path - 1, ring}, {path + 1, ring}}) {
      if (!Has(l, j)) continue;
      const int wrapped = (l + paths_) % paths_;
      if (const auto found = FindMarkerAt(gray_, PlaceFor(wrapped, j, At(l, j)), 0))
        least = std::min(least, found->contrast);
    }
    return least > 1e8 ? 0 : least;
  }

  std::optional<Cell> LookAt(int path, int ring) {
    auto cell = Predict(path, ring);
    if (!cell) return std::nullopt;
    const MarkerPlace place = PlaceFor(path, ring, *cell);
    const double radius = 0.5 * std::exp(0.5 * log_areas_[static_cast<size_t>(ring)]);
    if (!Inside(place.center_px, -0.8 * radius)) return std::nullopt;
    const double least = std::max(kMinContrast, kMinContrastPart * NeighbourContrast(path, ring));
    const auto found = FindMarkerAt(gray_, place, least);
    if (!found) return std::nullopt;
    const Detection& d = found->detection;
    if (!SizeFits(d, ring)) return std::nullopt;
    const double max_off = kMaxOffPlace * place.reach_px / 0.65 + (d.clipped ? radius : 0.5);
    if ((d.center_px - place.center_px).norm() > max_off || IsTaken(d)) return std::nullopt;
    const auto at = grid_.PlaceOf(d.center_px);
    if (at.path != path) return std::nullopt;
    const double displacement = DisplacementOf(grid_.TanAt(at.log_radius), ring);
    return Cell{BetterOf(d), at.off_path, at.log_radius, displacement, true};
  }

  bool IsTaken(const Detection& d) const {
    return std::any_of(cells_.begin(), cells_.end(), [&](const Cell& cell) {
      return cell.detection && (cell.detection->center_px - d.center_px).norm() <
                                   0.5 * std::sqrt(std::min(cell.detection->area_px2, d.area_px2));
    });
  }
  // The detector's own, if it was only not labelled: its centre is the better one.
  Detection BetterOf(const Detection& found) const {
    for (const Detection& d : detections_) {
      const double ratio = d.area_px2 / found.area_px2;
      if ((d.center_px - found.center_px).norm() < 0.25 * std::sqrt(found.area_px2) && ratio > 0.5 &&
          ratio < 2)
        return d;
    }
    return found;
  }

  Error Refusal(const std::string& why) const {
    return {ErrorCode::kInvalidArgument,
            "the " + std::string(Name(id_)) + " camera's picture can't be labelled: " + why +
                "; check the light, the link model and that little touches the skin"};
  }

  Result<void> CheckComplete() {
    int all = 0;
    for (int j = 0; j < rings_; ++j) {
      int seen = 0, inside = 0;
      for (int l = 0; l < paths_; ++l) {
        seen += Has(l, j) ? 1 : 0;
        const double size = std::exp(0.5 * log_areas_[static_cast<size_t>(j)]);
        inside += Inside(grid_.PixelOf(l, 0, grid_.ring_log_radii()[static_cast<size_t>(j)]), size) ? 1 : 0;
      }
      all += seen;
      if (seen < kMinOfRing * inside)
        return Refusal("of ring " + std::to_string(model_.RingOf(MarkerAt(0, j)) + 1) +
                       " hardly a marker is seen, the link may have fewer rings than the model");
    }
    if (all < kMinSeen * paths_ * rings_)
      return Refusal("only " + std::to_string(all) + " of " + std::to_string(paths_ * rings_) +
                     " markers found");
    return {};
  }

  PictureLabels Labels() {
    PictureLabels labels{.markers = {}, .grid = grid_};
    for (int l = 0; l < paths_; ++l) {
      for (int j = 0; j < rings_; ++j) {
        const Cell& cell = At(l, j);
        if (cell.detection) labels.markers.push_back({MarkerAt(l, j), *cell.detection, cell.looked_again});
      }
    }
    std::sort(labels.markers.begin(), labels.markers.end(),
              [](const auto& a, const auto& b) { return a.marker < b.marker; });
    return labels;
  }

  const LinkModel& model_;
  const CameraId id_;
  const CameraModel& camera_;
  Detections detections_;  // the given ones, then those found along the paths
  const size_t given_;
  const cv::Mat& gray_;
  const PictureGrid grid_;
  const int paths_, rings_;
  std::vector<double> along_mm_;          // rings, from the clamped end near the camera
  std::vector<std::vector<Spot>> spots_;  // by path, from near to far
  std::vector<double> log_areas_;         // by ring
  std::vector<Cell> cells_;
  int labelled_ = 0;
  ChainAlignment alignment_;
};

}  // namespace

Result<PictureLabels> LabelPicture(const LinkModel& model, CameraId id, const Detections& detections,
                                   const cv::Mat& gray) {
  auto grid = PictureGrid::Fit(model, id, detections);
  if (!grid) return grid.error();
  return PictureLabeller(model, id, detections, gray, *std::move(grid)).Run();
}

}  // namespace taclink
