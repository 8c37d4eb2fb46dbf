#include "sensing/camera/camera_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "sensing/camera/closed_form.h"
#include "sensing/camera/dome.h"
#include "sensing/camera/projection.h"

namespace taclink {
namespace {

constexpr double kSigmaFloorPx = 0.1;  // a detection is not believed to be better than this
constexpr double kMaxSigmaPx = 2;      // worse ones (clipped) do not count
constexpr int kRounds = 3;
constexpr double kMedianNorm = 1.177;  // of a 2-vector with unit variances
constexpr double kOutlierSigmas = 4.5;
constexpr double kStartPlaceMm = 6;  // tolerances that the closed form may use up
constexpr double kWidestRad = 1.2;

bool Usable(const MarkerObservation& one) {
  return one.seen && one.sigma_px() <= kMaxSigmaPx && one.center_px.allFinite();
}

std::vector<BundleSample> Collect(const RestShape& rest, const Vec3& camera_mm, bool domes,
                                  std::span<const MarkerObservation> seen) {
  std::vector<BundleSample> samples;
  for (size_t i = 0; i < seen.size(); ++i) {
    if (!Usable(seen[i])) continue;
    const int marker = static_cast<int>(i);
    const Mat2 floor = kSigmaFloorPx * kSigmaFloorPx * Mat2::Identity();
    samples.push_back({marker, SeenPoint(rest, marker, camera_mm, domes), seen[i].center_px,
                       seen[i].covariance_px2 + floor});
  }
  return samples;
}

bool SeesAll(const CameraModel& camera, const std::vector<BundleSample>& samples) {
  const Projector projector(camera);
  return std::all_of(samples.begin(), samples.end(),
                     [&](const BundleSample& s) { return projector.Project(s.rest_mm).has_value(); });
}

// The markers stay in place here, so their tolerance is counted with the pictures'.
std::vector<BundleSample> WithMould(const CameraModel& camera, std::vector<BundleSample> samples,
                                    double marker_mm) {
  const Projector projector(camera);
  for (BundleSample& s : samples) {
    const auto seen = projector.ProjectWithJacobian(s.rest_mm);
    if (seen) s.covariance_px2 += marker_mm * marker_mm * seen->jacobian * seen->jacobian.transpose();
  }
  return samples;
}

std::vector<double> Sigmas(const CameraModel& camera, const std::vector<BundleSample>& samples) {
  const Projector projector(camera);
  std::vector<double> sigmas;
  for (const BundleSample& s : samples) {
    const auto pixel = projector.Project(s.rest_mm);
    sigmas.push_back(pixel ? s.covariance_px2.llt().matrixL().solve(*pixel - s.pixel).norm()
                           : std::numeric_limits<double>::infinity());
  }
  return sigmas;
}

double Misfit(std::vector<double> sigmas) {
  const auto middle = sigmas.begin() + static_cast<std::ptrdiff_t>(sigmas.size() / 2);
  std::nth_element(sigmas.begin(), middle, sigmas.end());
  return std::max(1.0, *middle / kMedianNorm);
}

// One start's way: the covariances grow until they explain the residuals, or a lens that is not quite the
// model's would outweigh all that is known of the build. None: it leads nowhere.
std::optional<CameraFit> FollowStart(const CameraModel& start, const CameraModel& nominal,
                                     const std::vector<BundleSample>& samples,
                                     const CameraFitOptions& options) {
  if (!SeesAll(start, samples)) return std::nullopt;
  CameraFit fit;
  fit.camera = start;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<BundleSample> weighted = WithMould(fit.camera, samples, options.tolerance.marker_mm);
    fit.misfit = Misfit(Sigmas(fit.camera, weighted));
    for (BundleSample& s : weighted) s.covariance_px2 *= fit.misfit * fit.misfit;
    const BundleCamera camera{fit.camera, nominal, std::move(weighted)};
    const bool last = round + 1 == kRounds;
    fit.bundle = AdjustBundle(
        {&camera, 1}, {.tolerance = options.tolerance, .move_markers = false, .with_covariance = last});
    fit.camera = fit.bundle.cameras.front();
    if (!SeesAll(fit.camera, samples)) return std::nullopt;
  }
  if (!fit.bundle.converged) return std::nullopt;
  const std::vector<double> sigmas =
      Sigmas(fit.camera, WithMould(fit.camera, samples, options.tolerance.marker_mm));
  fit.misfit = Misfit(sigmas);
  for (size_t i = 0; i < samples.size(); ++i) {
    if (sigmas[i] <= kOutlierSigmas * fit.misfit) {
      fit.samples.push_back(samples[i]);
    } else {
      fit.outliers.push_back(samples[i].marker);
    }
  }
  return fit;
}

}  // namespace

Vec3 SeenPoint(const RestShape& rest, int marker, const Vec3& camera_mm, bool domes) {
  const LinkModel& model = rest.model();
  const Vec3 center = rest.Marker(marker);
  const double rise = model.markers.center_depth_mm - model.thickness_mm;
  if (!domes || rise <= 0) return center;
  return SeenOfDome(center, rest.Inward(marker), rise, camera_mm);
}

int CountUsable(std::span<const MarkerObservation> rest) {
  return static_cast<int>(std::count_if(rest.begin(), rest.end(), Usable));
}

std::optional<CameraFit> FitCamera(const RestShape& rest, CameraId id,
                                   std::span<const MarkerObservation> seen, const CameraFitOptions& options) {
  const LinkModel& model = rest.model();
  const CameraModel& nominal = model.nominal_rig[id];
  Vec3 camera_mm = nominal.camera_from_link.Inverse().translation;
  std::vector<BundleSample> samples = Collect(rest, camera_mm, options.domes, seen);
  const auto [closed_form, as_designed] = FindStarts(model, id, samples, kStartPlaceMm);
  std::optional<CameraFit> best;
  for (const CameraModel& start : {closed_form, as_designed}) {
    CameraModel converted = start;
    converted.lens = ConvertLens(start.lens, options.lens, kWidestRad);
    auto fit = FollowStart(converted, nominal, samples, options);
    if (!fit) continue;
    if (!best || std::pair(fit->misfit, fit->bundle.cost) < std::pair(best->misfit, best->bundle.cost)) {
      best = std::move(fit);
    }
  }
  if (!best || !options.domes) return best;
  // Once more: what is seen of a dome depends on where the camera is.
  camera_mm = best->camera.camera_from_link.Inverse().translation;
  samples = Collect(rest, camera_mm, true, seen);
  return FollowStart(best->camera, nominal, samples, options);
}

}  // namespace taclink
