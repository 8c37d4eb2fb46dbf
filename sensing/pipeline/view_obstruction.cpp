#include "sensing/pipeline/view_obstruction.h"

#include <algorithm>

namespace taclink {
namespace {

// Of links without faults in the whole benchmark, all but 0.1 % of the frames have three such markers at most
// of 240; those with a hair, or a drop of 80 px in diameter, four to twelve.
constexpr double kDisplacedPx = 0.5, kDisplacedMeans = 3, kDisplacedShare = 0.014;
constexpr double kMostInMeanPx = 1;   // outliers do not widen what is usual
constexpr double kOtherCamera = 0.5;  // of the limit: the other camera sees it where it is expected

double MeanResidualPx(const std::vector<std::optional<Vec2>>& residuals) {
  double sum = 0;
  int seen = 0;
  for (const auto& residual : residuals) {
    if (!residual) continue;
    sum += std::min(residual->norm(), kMostInMeanPx);
    ++seen;
  }
  return sum / std::max(1, seen);
}

}  // namespace

std::optional<ViewObstruction> FindViewObstruction(const LinkModel& model, const ImageResiduals& residuals) {
  ViewObstruction most;
  for (const CameraId id : kBothCameras) {
    const auto &here = residuals[Index(id)], &there = residuals[1 - Index(id)];
    const double limit_px = std::max(kDisplacedPx, kDisplacedMeans * MeanResidualPx(here));
    ViewObstruction found{.camera = id};
    for (size_t m = 0; m < std::min(here.size(), there.size()); ++m) {
      if (!here[m] || !there[m] || there[m]->norm() > kOtherCamera * limit_px) continue;
      const double px = here[m]->norm();
      if (px <= limit_px) continue;
      ++found.markers;
      if (px <= found.most_px) continue;
      found.most_px = px;
      found.marker = static_cast<int>(m);
    }
    if (found.markers > most.markers) most = found;
  }
  if (most.markers < kDisplacedShare * model.markers.count()) return std::nullopt;
  return most;
}

}  // namespace taclink
