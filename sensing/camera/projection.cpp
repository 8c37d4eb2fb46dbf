#include "sensing/camera/projection.h"

#include <cmath>

namespace taclink {
namespace {

constexpr int kMaxNewtonSteps = 20;

// theta(r) = atan2(r, f (1 + k1 r^2 + k2 r^4)); its derivative is positive while the model is usable.
double ThetaSlope(const LensModel& lens, double r) {
  const double r2 = r * r;
  const double depth = lens.focal_px * (1 + r2 * (lens.k1_per_px2 + r2 * lens.k2_per_px4));
  const double depth_slope = lens.focal_px * r * (2 * lens.k1_per_px2 + 4 * r2 * lens.k2_per_px4);
  return (depth - r * depth_slope) / (r2 + depth * depth);
}

double Theta(const LensModel& lens, double r) {
  const double r2 = r * r;
  return std::atan2(r, lens.focal_px * (1 + r2 * (lens.k1_per_px2 + r2 * lens.k2_per_px4)));
}

}  // namespace

Projector::Projector(const CameraModel& camera)
    : camera_(camera), center_in_link_(camera.camera_from_link.Inverse().translation) {
  // No picture point is further from the principal point than the farthest corner, with some room for markers
  // outside.
  const Vec2& c = camera.lens.principal_point_px;
  const double dx = std::max(c.x(), camera.width_px - c.x()), dy = std::max(c.y(), camera.height_px - c.y());
  const double corner = 1.25 * std::hypot(dx, dy);
  const int steps = 256;
  max_radius_px_ = 0;
  for (int i = 1; i <= steps; ++i) {
    const double r = corner * i / steps;
    if (ThetaSlope(camera.lens, r) <= 0) break;
    max_radius_px_ = r;
  }
  max_theta_rad_ = Theta(camera.lens, max_radius_px_);
}

double Projector::Undistort(double radius_px) const {
  const double r2 = radius_px * radius_px;
  return radius_px / (1 + r2 * (camera_.lens.k1_per_px2 + r2 * camera_.lens.k2_per_px4));
}

std::optional<std::array<double, 2>> Projector::RadiusAtAngle(double theta_rad) const {
  if (!(theta_rad >= 0 && theta_rad < max_theta_rad_)) return std::nullopt;
  // Newton on theta(r), which rises on [0, max]; bisection guards it.
  double low = 0, high = max_radius_px_;
  double r = std::min(camera_.lens.focal_px * theta_rad, 0.9 * max_radius_px_);
  for (int i = 0; i < kMaxNewtonSteps; ++i) {
    const double error = Theta(camera_.lens, r) - theta_rad;
    if (std::abs(error) < 1e-13) break;
    (error > 0 ? high : low) = r;
    const double slope = ThetaSlope(camera_.lens, r);
    double next = r - error / slope;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    r = next;
  }
  return std::array{r, 1 / ThetaSlope(camera_.lens, r)};
}

std::optional<Vec2> Projector::Project(const Vec3& p_in_link) const {
  const Vec3 p = camera_.camera_from_link * p_in_link;
  const double rho = std::hypot(p.x(), p.y());
  const auto radius = RadiusAtAngle(std::atan2(rho, p.z()));
  if (!radius) return std::nullopt;
  if (rho == 0) return camera_.lens.principal_point_px;
  return camera_.lens.principal_point_px + (*radius)[0] / rho * p.head<2>();
}

std::optional<Projector::WithJacobian> Projector::ProjectWithJacobian(const Vec3& p_in_link) const {
  const Vec3 p = camera_.camera_from_link * p_in_link;
  const double rho2 = p.head<2>().squaredNorm(), rho = std::sqrt(rho2);
  const auto radius = RadiusAtAngle(std::atan2(rho, p.z()));
  if (!radius) return std::nullopt;
  const auto [r, slope] = *radius;
  Eigen::Matrix<double, 2, 3> jacobian = Eigen::Matrix<double, 2, 3>::Zero();  // in the camera frame
  if (rho < 1e-9 * p.z()) {
    jacobian(0, 0) = jacobian(1, 1) = slope / p.z();
    return WithJacobian{camera_.lens.principal_point_px, jacobian * camera_.camera_from_link.rotation};
  }
  const Vec2 e = p.head<2>() / rho;
  const double distance2 = rho2 + p.z() * p.z();
  // pixel = r(theta) e: along e through theta, across e through e's turning.
  const Vec3 theta_by_p(e.x() * p.z() / distance2, e.y() * p.z() / distance2, -rho / distance2);
  jacobian = slope * e * theta_by_p.transpose();
  jacobian.leftCols<2>() += r / rho * (Mat2::Identity() - e * e.transpose());
  return WithJacobian{camera_.lens.principal_point_px + r * e, jacobian * camera_.camera_from_link.rotation};
}

std::optional<Vec3> Projector::Ray(const Vec2& pixel) const {
  const Vec2 d = pixel - camera_.lens.principal_point_px;
  const double r = d.norm();
  if (!(r <= max_radius_px_)) return std::nullopt;
  const double theta = Theta(camera_.lens, r);
  const Vec2 e = r > 0 ? Vec2(d / r) : Vec2(Vec2::Zero());
  const Vec3 in_camera(std::sin(theta) * e.x(), std::sin(theta) * e.y(), std::cos(theta));
  return Vec3(camera_.camera_from_link.rotation.transpose() * in_camera);
}

}  // namespace taclink
