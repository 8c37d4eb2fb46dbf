#include "sensing/pipeline/marker_radii.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sensing/core/similar_skin.h"

namespace taclink {
namespace {

constexpr double kMostSigmaMm = 0.15;  // of a marker that is compared, in units of length
constexpr double kMostSeenSigma = 0.1;
// A marker's radius by its distance from a camera along the axis: beyond, the axial motion beside a dent is
// too large in that picture, or the radial one too small.
constexpr double kLeastSlope = 0.2, kMostSlope = 1.2;
// A gauge holds so far about its pixel: its curvature is below 0.01 mm.
constexpr double kGaugeMm = 0.5;

constexpr float kUnseen = std::numeric_limits<float>::quiet_NaN();

// Of the markers whose motion one camera sees more of: the other's motion regressed on that one's.
struct Regression {
  int markers = 0;
  double squares_mm2 = 0, products_mm2 = 0, noise_mm4 = 0;

  void Add(double more_mm, double less_mm, double variance_mm2) {
    ++markers;
    squares_mm2 += more_mm * more_mm;
    products_mm2 += more_mm * less_mm;
    noise_mm4 += more_mm * more_mm * variance_mm2;
  }
  bool IsMotion(double least_mm) const {
    return markers >= kLeastMoved && squares_mm2 > markers * least_mm * least_mm;
  }
  bool IsAlone(double most_seen) const {
    return std::abs(products_mm2) < most_seen * squares_mm2 &&
           std::sqrt(noise_mm4) < kMostSeenSigma * squares_mm2;
  }
};

double Slope(const Vec3& place, const Projector& projector) {
  return place.head<2>().norm() / std::abs(place.z() - projector.center_in_link().z());
}

}  // namespace

RadiusReader::RadiusReader(const LinkModel& model, const StereoRig& rig, double noise_px)
    : model_(model),
      length_unit_(LengthUnit(model)),
      noise_px_(noise_px),
      projectors_{Projector(rig[CameraId::kTop]), Projector(rig[CameraId::kBottom])} {
  for (int marker = 0; marker < model_.markers.count(); ++marker) {
    const Vec3 place = model_.RestMarker(marker);
    const auto is_well_seen = [&](const Projector& projector) {
      const double slope = Slope(place, projector);
      return slope > kLeastSlope && slope < kMostSlope;
    };
    if (is_well_seen(projectors_[0]) && is_well_seen(projectors_[1])) compared_.push_back(marker);
  }
  for (auto& gauges : gauges_) gauges.resize(compared_.size());
}

void RadiusReader::Forget(MarkerRadii& radii) const {
  const auto count = static_cast<Eigen::Index>(compared_.size());
  radii.variances_mm2.setZero(count);
  for (auto& mm : radii.mm) mm.setConstant(count, kUnseen);
}

std::optional<RadiusReader::Reading> RadiusReader::ReadOne(size_t m, CameraId id,
                                                           const MarkerObservation& seen) {
  if (!seen.seen) return {};
  Gauge& gauge = gauges_[Index(id)][m];
  const Vec3 rest = model_.RestMarker(compared_[m]);
  const double rest_mm = rest.head<2>().norm();
  double mm = gauge.is_set ? gauge.radius_mm + gauge.by_px.dot(seen.center_px - gauge.about_px) : rest_mm;
  for (int i = 0; i < 3 && !(gauge.is_set && std::abs(mm - gauge.radius_mm) < kGaugeMm); ++i) {
    if (!(mm > 0 && mm < 3 * rest_mm)) mm = rest_mm;
    Vec3 place = rest;
    place.head<2>() *= mm / rest_mm;
    const auto projected = projectors_[Index(id)].ProjectWithJacobian(place);
    if (!projected) return {};
    const Vec2 by_mm = projected->jacobian * Vec3(rest.x(), rest.y(), 0) / rest_mm;
    const Vec2 by_px = by_mm / by_mm.squaredNorm();
    gauge = {true, projected->pixel, by_px, projected->jacobian.transpose() * by_px, mm};
    mm = gauge.radius_mm + gauge.by_px.dot(seen.center_px - gauge.about_px);
  }
  return Reading{mm, std::max(gauge.by_px.dot(seen.covariance_px2 * gauge.by_px),
                              noise_px_ * noise_px_ * gauge.by_px.squaredNorm())};
}

void RadiusReader::Read(const LabelledMarkers& markers, MarkerRadii& radii) {
  Forget(radii);
  const double most_variance_mm2 = std::pow(kMostSigmaMm * length_unit_, 2);
  for (size_t m = 0; m < compared_.size(); ++m) {
    const auto row = static_cast<Eigen::Index>(m);
    const auto marker = static_cast<size_t>(compared_[m]);
    for (const CameraId id : kBothCameras) {
      const auto& seen = markers.cameras[Index(id)];
      const auto reading = marker < seen.size() ? ReadOne(m, id, seen[marker]) : std::nullopt;
      if (!reading || !(reading->variance_mm2 < 0.5 * most_variance_mm2)) continue;
      radii.mm[Index(id)](row) = static_cast<float>(reading->mm);
      radii.variances_mm2(row) =
          std::max(radii.variances_mm2(row), static_cast<float>(reading->variance_mm2));
    }
  }
}

std::optional<SeenMotion> CompareRadii(const MarkerRadii& before, const MarkerRadii& now, double least_mm,
                                       double most_seen) {
  std::array<Regression, kCameraCount> sees_more{};
  for (Eigen::Index m = 0; m < now.variances_mm2.size(); ++m) {
    const double top_mm = now.mm[0](m) - before.mm[0](m), bottom_mm = now.mm[1](m) - before.mm[1](m),
                 variance_mm2 = now.variances_mm2(m) + before.variances_mm2(m);
    const bool is_top = std::abs(top_mm) > std::abs(bottom_mm);
    const double more_mm = is_top ? top_mm : bottom_mm, less_mm = is_top ? bottom_mm : top_mm;
    // Also false where either camera does not see it.
    if (!(more_mm * less_mm < std::numeric_limits<double>::max())) continue;
    if (more_mm * more_mm <= kMovedDeviations * kMovedDeviations * variance_mm2) continue;
    sees_more[Index(is_top ? CameraId::kTop : CameraId::kBottom)].Add(more_mm, less_mm, variance_mm2);
  }
  const bool is_more_top = sees_more[0].squares_mm2 > sees_more[1].squares_mm2;
  const CameraId id = is_more_top ? CameraId::kTop : CameraId::kBottom;
  const Regression& own = sees_more[Index(id)];
  if (!own.IsMotion(least_mm)) return {};
  return SeenMotion{own.IsAlone(most_seen) ? std::optional(id) : std::nullopt};
}

}  // namespace taclink
