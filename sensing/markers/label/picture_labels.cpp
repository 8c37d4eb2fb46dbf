#include "sensing/markers/label/picture_labels.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "sensing/core/median.h"
#include "sensing/core/similar_skin.h"
#include "sensing/markers/label/picture_labeller.h"

namespace taclink {
namespace {

constexpr int kMaxRounds = 12;
constexpr double kMaxAreaRatio = 2.2;   // of a marker against others of its ring
constexpr double kMinOfRing = 0.15;     // part of a ring's or a path's markers without which it is none
constexpr double kLeastLabelled = 0.5;  // of all markers
// Between rings, beside a spot's own width; closer, their spots run into one another.
constexpr double kResolvedPx = 2;

}  // namespace

Result<PictureLabels> PictureLabeller::Run() {
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

void PictureLabeller::SortIntoPaths() {
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

double PictureLabeller::SpacingAt(double log_radius) const {
  const auto j = static_cast<size_t>(NearestRing(log_radius));
  const auto& radii = grid_.ring_log_radii();
  const size_t next = std::min(j + 1, radii.size() - 1), before = j > 0 ? j - 1 : 0;
  return (radii[before] - radii[next]) / static_cast<double>(next - before);
}

int PictureLabeller::NearestRing(double log_radius) const {
  const auto& radii = grid_.ring_log_radii();
  const auto nearest = std::min_element(radii.begin(), radii.end(), [&](double a, double b) {
    return std::abs(a - log_radius) < std::abs(b - log_radius);
  });
  return static_cast<int>(nearest - radii.begin());
}

bool PictureLabeller::SizeFits(const Detection& d, int ring) const {
  const double ratio = d.area_px2 / std::exp(log_areas_[static_cast<size_t>(ring)]);
  return ratio < kMaxAreaRatio && (d.clipped || ratio > 1 / kMaxAreaRatio);
}

// By ring, of what is labelled; before, of what lies nearest to it.
void PictureLabeller::LearnAreas() {
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

Error PictureLabeller::Refusal(const std::string& why) const {
  return {ErrorCode::kInvalidArgument,
          "the " + std::string(Name(id_)) + " camera's picture can't be labelled: " + why +
              "; check the light, the link model and that little touches the skin"};
}

// Far rings of a skin that widens away from the camera are not.
bool PictureLabeller::IsResolved(int ring) const {
  const auto& radii = grid_.ring_log_radii();
  const auto radius_px = [&](int j) { return std::exp(radii[static_cast<size_t>(j)]); };
  const double apart = std::exp(0.5 * log_areas_[static_cast<size_t>(ring)]) + kResolvedPx;
  for (const int next : {ring - 1, ring + 1}) {
    if (next >= 0 && next < rings_ && std::abs(radius_px(next) - radius_px(ring)) < apart) return false;
  }
  return true;
}

Result<void> PictureLabeller::CheckComplete() {
  int all = 0;
  for (int j = 0; j < rings_; ++j) {
    int seen = 0, inside = 0;
    for (int l = 0; l < paths_; ++l) {
      seen += Has(l, j) ? 1 : 0;
      const double size = std::exp(0.5 * log_areas_[static_cast<size_t>(j)]);
      inside += Inside(grid_.PixelOf(l, 0, grid_.ring_log_radii()[static_cast<size_t>(j)]), size) ? 1 : 0;
    }
    all += seen;
    if (seen < kMinOfRing * inside && IsResolved(j))
      return Refusal(
          "near ring " + std::to_string(model_.RingOf(MarkerAt(0, j)) + 1) +
          " a ring of the model hardly shows: something covers it, or the link has fewer rings than "
          "the model");
  }
  if (all < kLeastLabelled * paths_ * rings_)
    return Refusal("only " + std::to_string(all) + " of " + std::to_string(paths_ * rings_) +
                   " markers found");
  return {};
}

PictureLabels PictureLabeller::Labels() {
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

Result<PictureLabels> LabelPicture(const LinkModel& model, CameraId id, const Detections& detections,
                                   const cv::Mat& gray) {
  const SimilarSkin skin(model, model.nominal_rig);
  auto grid = PictureGrid::Fit(skin.model, id, detections);
  if (!grid) return grid.error();
  return PictureLabeller(skin.model, id, detections, gray, *std::move(grid)).Run();
}

}  // namespace taclink
