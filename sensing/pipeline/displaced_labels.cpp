#include "sensing/pipeline/displaced_labels.h"

#include <algorithm>
#include <optional>

#include "sensing/camera/projection.h"
#include "sensing/markers/label/rest_labels.h"

namespace taclink {
namespace {

constexpr double kVisiblePx = 1;  // a displacement that moves no marker by more needs no correction
constexpr size_t kNeighbors = 4;

// What the displacement does to the image of one marker.
struct ImageShift {
  Vec2 at_px;  // displaced
  Vec2 shift_px;
};

std::vector<ImageShift> ShiftsOf(const RestShape& shape, const CameraModel& camera) {
  const Projector projector(camera);
  std::vector<ImageShift> shifts;
  for (int m = 0; m < shape.model().markers.count(); ++m) {
    const auto rest = projector.Project(shape.model().RestMarker(m));
    const auto displaced = projector.Project(shape.Marker(m));
    if (rest && displaced) shifts.push_back({*displaced, *displaced - *rest});
  }
  return shifts;
}

// The mean over the nearest markers, by inverse distance.
Vec2 ShiftAt(const std::vector<ImageShift>& shifts, const Vec2& px) {
  constexpr double kSofteningPx = 1;
  std::vector<std::pair<double, const ImageShift*>> nearest;
  for (const ImageShift& one : shifts) nearest.emplace_back((one.at_px - px).squaredNorm(), &one);
  const size_t count = std::min(kNeighbors, nearest.size());
  std::partial_sort(nearest.begin(), nearest.begin() + static_cast<std::ptrdiff_t>(count), nearest.end());
  Vec2 sum = Vec2::Zero();
  double weights = 0;
  for (size_t i = 0; i < count; ++i) {
    const double weight = 1 / (kSofteningPx * kSofteningPx + nearest[i].first);
    sum += weight * nearest[i].second->shift_px;
    weights += weight;
  }
  return weights > 0 ? Vec2(sum / weights) : Vec2::Zero();
}

}  // namespace

Result<std::vector<MarkerObservation>> LabelDisplacedRest(const RestShape& shape, CameraId id,
                                                          Detections& detections, const cv::Mat& gray) {
  const std::vector<ImageShift> shifts = ShiftsOf(shape, shape.model().nominal_rig[id]);
  const bool is_visible = std::any_of(shifts.begin(), shifts.end(), [](const ImageShift& one) {
    return one.shift_px.squaredNorm() > kVisiblePx * kVisiblePx;
  });
  if (!is_visible) return LabelRestPicture(shape.model(), id, detections, gray);
  Detections moved_back = detections;
  for (Detection& spot : moved_back) spot.center_px -= ShiftAt(shifts, spot.center_px);
  auto labels = LabelRestPicture(shape.model(), id, moved_back);
  if (!labels) return labels.error();
  for (MarkerObservation& label : *labels) {
    if (!label.seen) continue;
    const auto spot = std::find_if(moved_back.begin(), moved_back.end(),
                                   [&](const Detection& one) { return one.center_px == label.center_px; });
    if (spot == moved_back.end()) {
      label = {};
      continue;
    }
    label.center_px = detections[static_cast<size_t>(spot - moved_back.begin())].center_px;
  }
  return labels;
}

}  // namespace taclink
