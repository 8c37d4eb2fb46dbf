#include "sensing/core/link_model.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace taclink {
namespace {

// Second derivatives of the natural cubic spline (tridiagonal system, Thomas algorithm).
std::vector<double> NaturalSplineSecondDerivatives(const std::vector<double>& z,
                                                   const std::vector<double>& r) {
  const size_t n = z.size();
  std::vector<double> m(n, 0.0), upper(n, 0.0);
  for (size_t i = 1; i + 1 < n; ++i) {
    const double h0 = z[i] - z[i - 1], h1 = z[i + 1] - z[i];
    const double rhs = 6 * ((r[i + 1] - r[i]) / h1 - (r[i] - r[i - 1]) / h0);
    const double pivot = 2 * (h0 + h1) - h0 * upper[i - 1];
    upper[i] = h1 / pivot;
    m[i] = (rhs - h0 * m[i - 1]) / pivot;
  }
  for (size_t i = n - 1; i-- > 1;) m[i] -= upper[i] * m[i + 1];
  return m;
}

struct SplinePiece {
  size_t i;
  double h, a, b;  // a, b: distances to the right and left knot over h
};

SplinePiece FindPiece(const std::vector<double>& z, double at) {
  const auto right = std::upper_bound(z.begin() + 1, z.end() - 1, at);
  const auto i = static_cast<size_t>(right - z.begin()) - 1;
  const double h = z[i + 1] - z[i];
  return {i, h, (z[i + 1] - at) / h, (at - z[i]) / h};
}

}  // namespace

RadiusProfile RadiusProfile::Constant(double radius_mm) {
  return RadiusProfile(ConstantShape{radius_mm});
}

RadiusProfile RadiusProfile::Arc(double length_mm, double end_mm, double middle_mm) {
  const double rise = middle_mm - end_mm;
  if (rise == 0) return Constant(end_mm);
  const double half = length_mm / 2;
  const double arc_radius = (half * half + rise * rise) / (2 * std::abs(rise));
  const double sign = rise > 0 ? 1 : -1;
  return RadiusProfile(ArcShape{half, middle_mm - sign * arc_radius, arc_radius, sign});
}

RadiusProfile RadiusProfile::Spline(const std::vector<std::pair<double, double>>& points_mm) {
  SplineShape shape;
  for (const auto& [z, r] : points_mm) {
    shape.z.push_back(z);
    shape.r.push_back(r);
  }
  shape.second_derivative = NaturalSplineSecondDerivatives(shape.z, shape.r);
  return RadiusProfile(std::move(shape));
}

double RadiusProfile::Radius(double z_mm) const {
  if (const auto* constant = std::get_if<ConstantShape>(&shape_)) return constant->radius;
  if (const auto* arc = std::get_if<ArcShape>(&shape_)) {
    const double dz = z_mm - arc->center_z;
    return arc->center_r + arc->sign * std::sqrt(arc->arc_radius * arc->arc_radius - dz * dz);
  }
  const auto& s = std::get<SplineShape>(shape_);
  const auto [i, h, a, b] = FindPiece(s.z, z_mm);
  return a * s.r[i] + b * s.r[i + 1] +
         h * h / 6 *
             ((a * a * a - a) * s.second_derivative[i] + (b * b * b - b) * s.second_derivative[i + 1]);
}

double RadiusProfile::Slope(double z_mm) const {
  if (std::holds_alternative<ConstantShape>(shape_)) return 0;
  if (const auto* arc = std::get_if<ArcShape>(&shape_)) {
    const double dz = z_mm - arc->center_z;
    return -arc->sign * dz / std::sqrt(arc->arc_radius * arc->arc_radius - dz * dz);
  }
  const auto& s = std::get<SplineShape>(shape_);
  const auto [i, h, a, b] = FindPiece(s.z, z_mm);
  return (s.r[i + 1] - s.r[i]) / h +
         h / 6 * ((1 - 3 * a * a) * s.second_derivative[i] + (3 * b * b - 1) * s.second_derivative[i + 1]);
}

RadiusProfile RadiusProfile::Scaled(double scale) const {
  if (const auto* constant = std::get_if<ConstantShape>(&shape_)) return Constant(scale * constant->radius);
  if (const auto* arc = std::get_if<ArcShape>(&shape_))
    return RadiusProfile(
        ArcShape{scale * arc->center_z, scale * arc->center_r, scale * arc->arc_radius, arc->sign});
  SplineShape spline = std::get<SplineShape>(shape_);
  for (double& z : spline.z) z *= scale;
  for (double& r : spline.r) r *= scale;
  for (double& bend : spline.second_derivative) bend /= scale;
  return RadiusProfile(std::move(spline));
}

Vec3 LinkModel::OutwardNormal(double angle_rad, double z_mm) const {
  const double slope = profile.Slope(z_mm);
  return Vec3(std::cos(angle_rad), std::sin(angle_rad), -slope).normalized();
}

Vec3 LinkModel::PointAtDepth(double angle_rad, double z_mm, double depth_mm) const {
  const double r = profile.Radius(z_mm);
  const Vec3 on_profile(r * std::cos(angle_rad), r * std::sin(angle_rad), z_mm);
  return on_profile + (profile_depth_mm - depth_mm) * OutwardNormal(angle_rad, z_mm);
}

Vec3 LinkModel::RestMarker(int marker) const {
  return PointAtDepth(PathAngle(PathOf(marker)), markers.rings_z_mm[static_cast<size_t>(RingOf(marker))],
                      markers.center_depth_mm);
}

std::vector<Vec3> LinkModel::RestMarkers() const {
  std::vector<Vec3> points;
  points.reserve(static_cast<size_t>(markers.count()));
  for (int i = 0; i < markers.count(); ++i) points.push_back(RestMarker(i));
  return points;
}

const char* Name(MaterialLaw law) {
  return law == MaterialLaw::kNeoHookean ? "neo_hookean" : "saint_venant_kirchhoff";
}

}  // namespace taclink
