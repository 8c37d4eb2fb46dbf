// PictureLabeller: looks in the picture for markers that the detector did not find.

#include <algorithm>
#include <cmath>
#include <utility>

#include "sensing/markers/label/picture_labeller.h"

namespace taclink {
namespace {

// Off the predicted place in gaps to the next ring, contrast against the neighbours, gray levels.
constexpr double kMaxOffPlace = 0.3, kMinContrastPart = 0.2, kMinContrast = 6;
constexpr double kWideGap = 1.5, kNarrowGap = 0.5;  // between spots, in the rings' spacing at rest

}  // namespace

// Dim markers in the gaps of a path and beyond its last spot: alignment is sure where it can count.
void PictureLabeller::FillChain(int path) {
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
    const MarkerPlace place = PlaceFor(path, NearestRing(cell.log_radius), cell);
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

// Displacement of an empty place, by the next rings on both sides or one and both neighbouring paths.
std::optional<PictureLabeller::Cell> PictureLabeller::Predict(int path, int ring) {
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
double PictureLabeller::GapTo(int path, int ring, int step, double log_radius) {
  const int next = ring + step;
  const auto& radii = grid_.ring_log_radii();
  if (Has(path, next)) return std::abs(At(path, next).log_radius - log_radius);
  const int other = next < 0 || next >= rings_ ? ring - step : next;
  return std::abs(radii[static_cast<size_t>(other)] - radii[static_cast<size_t>(ring)]);
}

void PictureLabeller::LookAgain() {
  std::vector<std::pair<size_t, Cell>> found;
  for (int l = 0; l < paths_; ++l) {
    for (int j = 0; j < rings_; ++j) {
      if (Has(l, j)) continue;
      if (auto cell = LookAt(l, j)) found.emplace_back(static_cast<size_t>(l * rings_ + j), *cell);
    }
  }
  for (auto& [index, cell] : found) cells_[index] = cell;
}

MarkerPlace PictureLabeller::PlaceFor(int path, int ring, const Cell& cell) {
  const Vec2 center = grid_.PixelOf(path, cell.off_path, cell.log_radius);
  const Vec2 out = grid_.PixelOf(path, cell.off_path, cell.log_radius + 0.01);
  const double radius = (center - grid_.center_px()).norm();
  const double gap =
      radius * std::min(GapTo(path, ring, -1, cell.log_radius), GapTo(path, ring, 1, cell.log_radius));
  const double size = std::exp(0.5 * log_areas_[static_cast<size_t>(ring)]);
  return {center, (out - center).normalized(), 0.65 * gap, 0.5 * size, 0.6 * size};
}

// What contrast the neighbours have, found in the same way; the least of them.
double PictureLabeller::NeighbourContrast(int path, int ring) {
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

std::optional<PictureLabeller::Cell> PictureLabeller::LookAt(int path, int ring) {
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

bool PictureLabeller::IsTaken(const Detection& d) const {
  return std::any_of(cells_.begin(), cells_.end(), [&](const Cell& cell) {
    return cell.detection && (cell.detection->center_px - d.center_px).norm() <
                                 0.5 * std::sqrt(std::min(cell.detection->area_px2, d.area_px2));
  });
}

// The detector's own, if it was only not labelled: its centre is the better one.
Detection PictureLabeller::BetterOf(const Detection& found) const {
  for (const Detection& d : detections_) {
    const double ratio = d.area_px2 / found.area_px2;
    if ((d.center_px - found.center_px).norm() < 0.25 * std::sqrt(found.area_px2) && ratio > 0.5 && ratio < 2)
      return d;
  }
  return found;
}

}  // namespace taclink
