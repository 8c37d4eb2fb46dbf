#include "sensing/camera/rest_check.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "sensing/camera/camera_fit.h"
#include "sensing/camera/projection.h"
#include "sensing/core/median.h"

namespace taclink {
namespace {

constexpr size_t kLeastNeighbours = 5;  // of a marker and the 8 around it
// A mould's shape may be off by as much as 1 mm, smoothly; a patch is a touch if it stands out from such
// errors, or is deeper than any.
constexpr double kStandsOut = 3.5;
constexpr double kNoMouldMm = 1.2;

// How far each marker lies further in than the model has it, if it moved along the radius only: least squares
// over the pictures that show it. None: unseen.
std::vector<std::optional<double>> InwardShifts(const RestShape& shape, const CalibrationSummary& summary) {
  const LinkModel& model = shape.model();
  std::vector<std::optional<double>> inward(static_cast<size_t>(model.markers.count()));
  const Projector top(summary.rig[CameraId::kTop]), bottom(summary.rig[CameraId::kBottom]);
  for (size_t i = 0; i < inward.size(); ++i) {
    const Vec3 p = shape.Marker(static_cast<int>(i));
    const Vec3 in(-p.x() / p.head<2>().norm(), -p.y() / p.head<2>().norm(), 0);
    double along = 0, squares = 0;
    for (const CameraId id : kBothCameras) {
      const auto& residuals = summary.cameras[Index(id)].residuals;
      if (i >= residuals.size() || residuals[i].kind == MarkerResidual::Kind::kUnseen) continue;
      const auto seen = (id == CameraId::kTop ? top : bottom).ProjectWithJacobian(p);
      if (!seen) continue;
      const Vec2 px_per_mm = seen->jacobian * in;
      along += px_per_mm.dot(residuals[i].residual_px);
      squares += px_per_mm.squaredNorm();
    }
    if (squares > 0) inward[i] = along / squares;
  }
  return inward;
}

// A lens that is not quite the model's shows on whole rings, a touch on a part of one.
void SubtractRings(const LinkModel& model, std::vector<std::optional<double>>& inward) {
  std::vector<double> ring;
  for (int j = 0; j < model.markers.rings(); ++j) {
    ring.clear();
    for (int l = 0; l < model.markers.paths; ++l) {
      if (const auto& one = inward[static_cast<size_t>(model.MarkerIndex(l, j))]) ring.push_back(*one);
    }
    if (ring.empty()) continue;
    const double middle = Median(ring);
    for (int l = 0; l < model.markers.paths; ++l) {
      if (auto& one = inward[static_cast<size_t>(model.MarkerIndex(l, j))]) *one -= middle;
    }
  }
}

// The median of a marker and those around it; none: too few of them are seen.
std::optional<double> Patch(const LinkModel& model, const std::vector<std::optional<double>>& inward,
                            int marker) {
  std::vector<double> near;
  const int paths = model.markers.paths;
  for (int dj = -1; dj <= 1; ++dj) {
    const int ring = model.RingOf(marker) + dj;
    if (ring < 0 || ring >= model.markers.rings()) continue;
    for (int dl = -1; dl <= 1; ++dl) {
      const int path = (model.PathOf(marker) + dl + paths) % paths;
      if (const auto& one = inward[static_cast<size_t>(model.MarkerIndex(path, ring))]) near.push_back(*one);
    }
  }
  if (near.size() < kLeastNeighbours) return std::nullopt;
  return Median(near);
}

}  // namespace

std::optional<Dent> FindDent(const RestShape& shape, const CalibrationSummary& summary, double limit_mm) {
  const LinkModel& model = shape.model();
  std::vector<std::optional<double>> inward = InwardShifts(shape, summary);
  SubtractRings(model, inward);
  std::vector<double> sizes;
  std::vector<std::pair<int, double>> patches;
  for (int i = 0; i < model.markers.count(); ++i) {
    const auto patch = Patch(model, inward, i);
    if (!patch) continue;
    patches.emplace_back(i, *patch);
    sizes.push_back(std::abs(*patch));
  }
  if (patches.empty()) return std::nullopt;
  const double limit = std::max(limit_mm, std::min(kNoMouldMm, kStandsOut * 1.4826 * Median(sizes)));
  const auto worst = std::max_element(patches.begin(), patches.end(), [](const auto& a, const auto& b) {
    return std::abs(a.second) < std::abs(b.second);
  });
  if (std::abs(worst->second) <= limit) return std::nullopt;
  const auto moved = std::count_if(inward.begin(), inward.end(), [&](const auto& one) {
    return one && *one * worst->second > 0 && std::abs(*one) > limit_mm;
  });
  return Dent{worst->first, static_cast<int>(moved), worst->second};
}

CalibrationSummary ResidualsOf(const RestShape& shape, const StereoRig& rig, const LabelledMarkers& rest) {
  CalibrationSummary summary;
  summary.rig = rig;
  double squares = 0;
  int used = 0;
  for (const CameraId id : kBothCameras) {
    const Projector projector(rig[id]);
    auto& residuals = summary.cameras[Index(id)].residuals;
    for (int m = 0; m < shape.model().markers.count(); ++m) {
      const MarkerObservation& seen = rest.cameras[Index(id)][static_cast<size_t>(m)];
      const auto expected = projector.Project(SeenPoint(shape, m, projector.center_in_link(), true));
      residuals.emplace_back();
      if (!seen.seen || !expected) continue;
      residuals.back() = {MarkerResidual::Kind::kUsed, seen.center_px, seen.center_px - *expected};
      squares += residuals.back().residual_px.squaredNorm();
      ++used;
    }
  }
  summary.rms_px = std::sqrt(squares / (2.0 * std::max(1, used)));
  return summary;
}

std::string Describe(const LinkModel& model, const Dent& dent) {
  char text[256];
  std::snprintf(
      text, sizeof text,
      "near path %d, ring %d %d markers lie up to %.1f mm %s the model's rest shape; take the rest images "
      "again with nothing at the skin; if nothing is there, check that the model is this link's",
      model.PathOf(dent.marker) + 1, model.RingOf(dent.marker) + 1, dent.markers, std::abs(dent.depth_mm),
      dent.depth_mm > 0 ? "inside" : "outside");
  return text;
}

}  // namespace taclink
