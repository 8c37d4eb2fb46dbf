#include "sensing/shape/reconstructor.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "sensing/shape/inference.h"

namespace taclink {
namespace {

constexpr int kSteps = 1;            // Gauss-Newton; the start is nearly there
constexpr double kEndMarginMm = 10;  // a marker may lie this far beyond a clamped end's plane: it does not

double Variance(double sigma_px, double camera_sigma_px) {
  return sigma_px * sigma_px + camera_sigma_px * camera_sigma_px;
}

}  // namespace

ShapeReconstructor::ShapeReconstructor(const LinkModel& model, const StereoRig& rig, ShapeOptions options)
    : model_(model),
      options_(options),
      projectors_{Projector(rig[CameraId::kTop]), Projector(rig[CameraId::kBottom])},
      length_mm_(model.length_mm),
      tube_radius_mm_(model.tube_outer_radius_mm),
      model_rest_mm_(model.RestMarkers()),
      baseline_mm_(model_rest_mm_),
      baseline_covariance_mm2_(model_rest_mm_.size(), Mat3::Zero()) {
  for (const Vec3& p : model_rest_mm_) rest_radius_mm_.push_back(p.head<2>().norm());
}

void ShapeReconstructor::SetBaseline(const SkinShape& rest) {
  for (size_t i = 0; i < baseline_mm_.size(); ++i) {
    const bool measured = i < rest.sources.size() && rest.sources[i] != MarkerSource::kInferred;
    baseline_mm_[i] = measured ? rest.positions_mm[i] : model_rest_mm_[i];
    // The shape's covariance may hold an older baseline's; it is that of a single measurement otherwise.
    baseline_covariance_mm2_[i] =
        measured ? Mat3(rest.covariances_mm2[i] - baseline_covariance_mm2_[i])
                 : Mat3(options_.unseen_rest_sigma_mm * options_.unseen_rest_sigma_mm * Mat3::Identity());
  }
}

void ShapeReconstructor::Reconstruct(const LabelledMarkers& markers, SkinShape& shape) {
  const size_t count = model_rest_mm_.size();
  shape.positions_mm.resize(count);
  shape.displacements_mm.resize(count);
  shape.covariances_mm2.resize(count);
  shape.sources.assign(count, MarkerSource::kInferred);
  static const MarkerObservation kUnseen;
  for (size_t i = 0; i < count; ++i) {
    shape.positions_mm[i] = baseline_mm_[i];
    const MarkerObservation& top = i < markers.cameras[0].size() ? markers.cameras[0][i] : kUnseen;
    const MarkerObservation& bottom = i < markers.cameras[1].size() ? markers.cameras[1][i] : kUnseen;
    if (top.seen && bottom.seen) {
      if (Triangulate(top, bottom, i, shape)) shape.sources[i] = MarkerSource::kBoth;
    } else if (top.seen) {
      if (FromOneCamera(CameraId::kTop, top, i, shape)) shape.sources[i] = MarkerSource::kTop;
    } else if (bottom.seen) {
      if (FromOneCamera(CameraId::kBottom, bottom, i, shape)) shape.sources[i] = MarkerSource::kBottom;
    }
    shape.displacements_mm[i] = shape.positions_mm[i] - baseline_mm_[i];
  }
  InferUnseen(model_, options_.inferred_sigma_mm, shape);
  for (size_t i = 0; i < count; ++i) shape.covariances_mm2[i] += baseline_covariance_mm2_[i];
}

bool ShapeReconstructor::Plausible(const Vec3& p, size_t marker) const {
  const double radius = p.head<2>().norm();
  return p.allFinite() && radius >= tube_radius_mm_ &&
         radius <= rest_radius_mm_[marker] + options_.max_outward_mm && p.z() > -kEndMarginMm &&
         p.z() < length_mm_ + kEndMarginMm;
}

bool ShapeReconstructor::Triangulate(const MarkerObservation& top, const MarkerObservation& bottom,
                                     size_t marker, SkinShape& shape) const {
  const std::array<const MarkerObservation*, kCameraCount> seen = {&top, &bottom};
  std::array<SightRay, kCameraCount> rays;
  for (size_t c = 0; c < rays.size(); ++c) {
    const auto direction = projectors_[c].Ray(seen[c]->center_px);
    if (!direction) return false;
    rays[c] = {projectors_[c].center_in_link(), *direction};
  }
  const auto meeting = MeetRays(rays[0], rays[1]);
  if (!meeting) return false;
  Vec3 p = meeting->point_mm;
  Mat3 normal = Mat3::Identity(), covariance;
  for (int step = 0; step <= kSteps; ++step) {
    normal.setZero();
    Vec3 gradient = Vec3::Zero();
    for (size_t c = 0; c < seen.size(); ++c) {
      const auto projected = projectors_[c].ProjectWithJacobian(p);
      if (!projected) return false;
      const double variance = Variance(seen[c]->sigma_px(), options_.camera_sigma_px);
      const Vec2 residual = seen[c]->center_px - projected->pixel;
      // The last round only judges what the steps have reached.
      const double gate =
          options_.max_residual_sigmas * std::max(std::sqrt(variance), options_.min_gate_sigma_px);
      if (step == kSteps && residual.norm() > gate) return false;
      normal += projected->jacobian.transpose() * projected->jacobian / variance;
      gradient += projected->jacobian.transpose() * residual / variance;
    }
    bool invertible = false;
    normal.computeInverseWithCheck(covariance, invertible, 0.0);
    if (!invertible) return false;
    if (step < kSteps) p += covariance * gradient;
  }
  if (!Plausible(p, marker)) return false;
  shape.positions_mm[marker] = p;
  shape.covariances_mm2[marker] = covariance;
  return true;
}

bool ShapeReconstructor::FromOneCamera(CameraId id, const MarkerObservation& seen, size_t marker,
                                       SkinShape& shape) const {
  const Projector& projector = projectors_[Index(id)];
  const auto direction = projector.Ray(seen.center_px);
  if (!direction) return false;
  const auto p = SightRay{projector.center_in_link(), *direction}.AtZ(baseline_mm_[marker].z());
  if (!p || !Plausible(*p, marker)) return false;
  const auto projected = projector.ProjectWithJacobian(*p);
  if (!projected) return false;
  // Across: the pixel's error in the plane z = const. Along: the assumed z moves the point on its ray.
  Mat2 pixel_to_plane;
  bool invertible = false;
  const Mat2 plane_to_pixel = projected->jacobian.leftCols<2>();
  plane_to_pixel.computeInverseWithCheck(pixel_to_plane, invertible, 0.0);
  if (!invertible) return false;
  const Vec3 along = *direction / direction->z();
  Mat3 covariance = options_.assumed_z_sigma_mm * options_.assumed_z_sigma_mm * (along * along.transpose());
  covariance.topLeftCorner<2, 2>() +=
      Variance(seen.sigma_px(), options_.camera_sigma_px) * (pixel_to_plane * pixel_to_plane.transpose());
  shape.positions_mm[marker] = *p;
  shape.covariances_mm2[marker] = covariance;
  return true;
}

}  // namespace taclink
