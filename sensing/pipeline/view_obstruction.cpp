#include "sensing/pipeline/view_obstruction.h"

#include <algorithm>

namespace taclink {
namespace {

// Of links without faults in the whole benchmark, all but 0.1 % of the frames have three such markers at most
// of 240; those with a hair, or a drop of 80 px in diameter, four to twelve.
constexpr double kDisplacedPx = 0.5, kDisplacedMeans = 3, kDisplacedShare = 0.014;
constexpr double kDisplacedSigmas = 4;  // of the observation
constexpr int kLeastDisplaced = 4;
constexpr double kMostShare = 0.25;  // of the markers that both cameras see; more are displaced by the camera
constexpr double kMostInMeanPx = 0.5;  // outliers do not widen what is usual
constexpr double kOtherCamera = 0.5;   // of the limit: the other camera sees it where it is expected

// Of a ring's markers in one image. Those of the far ring are small, and scatter more.
double MeanResidualPx(const LinkModel& model, const std::vector<std::optional<ImageResidual>>& residuals,
                      int ring) {
  double sum_px = 0;
  int seen = 0;
  for (int path = 0; path < model.markers.paths; ++path) {
    const auto& residual = residuals[static_cast<size_t>(model.MarkerIndex(path, ring))];
    if (!residual) continue;
    sum_px += std::min(residual->px.norm(), kMostInMeanPx);
    ++seen;
  }
  return sum_px / std::max(1, seen);
}

}  // namespace

std::optional<ViewObstruction> FindViewObstruction(const LinkModel& model, const ImageResiduals& residuals) {
  ViewObstruction most;
  const auto count = static_cast<size_t>(model.markers.count());
  if (residuals[0].size() != count || residuals[1].size() != count) return std::nullopt;
  for (const CameraId id : kBothCameras) {
    const auto &here = residuals[Index(id)], &there = residuals[1 - Index(id)];
    ViewObstruction found{.camera = id};
    double limit_px = 0;
    int compared = 0;
    for (size_t m = 0; m < count; ++m) {
      const auto marker = static_cast<int>(m);
      if (model.PathOf(marker) == 0)
        limit_px =
            std::max(kDisplacedPx, kDisplacedMeans * MeanResidualPx(model, here, model.RingOf(marker)));
      if (!here[m] || !there[m]) continue;
      ++compared;
      if (there[m]->px.norm() > kOtherCamera * limit_px) continue;
      const double px = here[m]->px.norm();
      if (px <= limit_px || here[m]->sigmas <= kDisplacedSigmas) continue;
      ++found.markers;
      if (px <= found.most_px) continue;
      found.most_px = px;
      found.marker = marker;
    }
    if (found.markers > most.markers && found.markers <= kMostShare * compared) most = found;
  }
  const double least = std::max<double>(kLeastDisplaced, kDisplacedShare * model.markers.count());
  if (most.markers < least) return std::nullopt;
  return most;
}

}  // namespace taclink
