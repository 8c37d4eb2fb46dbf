#include "sensing/camera/projection.h"

#include <cmath>

namespace taclink {
namespace {

// No picture point is further from the principal point than the farthest corner, with some room for markers
// outside.
double FarthestCornerPx(const CameraModel& camera) {
  const Vec2& c = camera.lens.principal_point_px;
  const double dx = std::max(c.x(), camera.width_px - c.x()), dy = std::max(c.y(), camera.height_px - c.y());
  return 1.25 * std::hypot(dx, dy);
}

Mat3 CrossProduct(const Vec3& v) {
  return (Mat3() << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0).finished();
}

Mat3 Rotation(const Vec3& vector) {
  const double angle = vector.norm();
  return angle > 0 ? Mat3(Eigen::AngleAxisd(angle, vector / angle)) : Mat3(Mat3::Identity());
}

}  // namespace

CameraModel Moved(const CameraModel& camera, const CameraStep& step) {
  CameraModel moved = camera;
  const Vec3 center = camera.camera_from_link.Inverse().translation + step.segment<3>(3);
  moved.camera_from_link.rotation = Rotation(step.head<3>()) * camera.camera_from_link.rotation;
  moved.camera_from_link.translation = -(moved.camera_from_link.rotation * center);
  moved.lens.principal_point_px += step.segment<2>(6);
  SetParameters(ParametersOf(camera.lens) + step.tail<kMaxLensParameters>(), moved.lens);
  return moved;
}

CameraStep StepBetween(const CameraModel& from, const CameraModel& to) {
  CameraStep step;
  const Eigen::AngleAxisd turn(
      Mat3(to.camera_from_link.rotation * from.camera_from_link.rotation.transpose()));
  step << turn.angle() * turn.axis(),
      to.camera_from_link.Inverse().translation - from.camera_from_link.Inverse().translation,
      to.lens.principal_point_px - from.lens.principal_point_px,
      ParametersOf(to.lens) - ParametersOf(from.lens);
  return step;
}

Projector::Projector(const CameraModel& camera)
    : camera_(camera),
      center_in_link_(camera.camera_from_link.Inverse().translation),
      lens_(camera.lens, FarthestCornerPx(camera)) {}

std::optional<Vec2> Projector::Project(const Vec3& p_in_link) const {
  const Vec3 p = camera_.camera_from_link * p_in_link;
  const double rho = std::sqrt(p.head<2>().squaredNorm());
  const auto radius = lens_.AtPoint(rho, p.z());
  if (!radius) return std::nullopt;
  if (rho == 0) return camera_.lens.principal_point_px;
  return camera_.lens.principal_point_px + radius->px / rho * p.head<2>();
}

std::optional<Projector::WithJacobian> Projector::InCamera(const Vec3& p, Lens::Radius& radius) const {
  const double rho2 = p.head<2>().squaredNorm(), rho = std::sqrt(rho2);
  const auto found = lens_.AtPoint(rho, p.z());
  if (!found) return std::nullopt;
  radius = *found;
  WithJacobian result{camera_.lens.principal_point_px, Eigen::Matrix<double, 2, 3>::Zero()};
  if (rho < 1e-9 * p.z()) {
    result.jacobian(0, 0) = result.jacobian(1, 1) = radius.px_per_rad / p.z();
    return result;
  }
  const Vec2 e = p.head<2>() / rho;
  const double distance2 = rho2 + p.z() * p.z();
  // pixel = r(theta) e: along e through theta, across e through e's turning.
  const Vec3 theta_by_p(e.x() * p.z() / distance2, e.y() * p.z() / distance2, -rho / distance2);
  result.pixel += radius.px * e;
  result.jacobian = radius.px_per_rad * e * theta_by_p.transpose();
  result.jacobian.leftCols<2>() += radius.px / rho * (Mat2::Identity() - e * e.transpose());
  return result;
}

std::optional<Projector::WithJacobian> Projector::ProjectWithJacobian(const Vec3& p_in_link) const {
  Lens::Radius radius;
  auto result = InCamera(camera_.camera_from_link * p_in_link, radius);
  if (result) result->jacobian = (result->jacobian * camera_.camera_from_link.rotation).eval();
  return result;
}

std::optional<Projector::WithCameraJacobian> Projector::ProjectWithCameraJacobian(
    const Vec3& p_in_link) const {
  const Vec3 p = camera_.camera_from_link * p_in_link;
  Lens::Radius radius;
  const auto seen = InCamera(p, radius);
  if (!seen) return std::nullopt;
  WithCameraJacobian result;
  result.pixel = seen->pixel;
  result.by_point = seen->jacobian * camera_.camera_from_link.rotation;
  result.by_camera.leftCols<3>() = -seen->jacobian * CrossProduct(p);
  result.by_camera.middleCols<3>(3) = -result.by_point;
  result.by_camera.middleCols<2>(6).setIdentity();
  const double rho = std::sqrt(p.head<2>().squaredNorm());
  const Vec2 e = rho > 0 ? Vec2(p.head<2>() / rho) : Vec2(Vec2::Zero());
  const LensParameters by_lens = lens_.RadiusByParameters(std::atan2(rho, p.z()), radius.px);
  result.by_camera.rightCols<kMaxLensParameters>() = e * by_lens.transpose();
  return result;
}

std::optional<Vec3> Projector::Ray(const Vec2& pixel) const {
  const Vec2 d = pixel - camera_.lens.principal_point_px;
  const double r = d.norm();
  const auto theta = lens_.AngleAt(r);
  if (!theta) return std::nullopt;
  const Vec2 e = r > 0 ? Vec2(d / r) : Vec2(Vec2::Zero());
  const Vec3 in_camera(std::sin(*theta) * e.x(), std::sin(*theta) * e.y(), std::cos(*theta));
  return Vec3(camera_.camera_from_link.rotation.transpose() * in_camera);
}

}  // namespace taclink
