#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <numbers>

namespace taclink {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat2 = Eigen::Matrix2d;
using Mat3 = Eigen::Matrix3d;

inline constexpr double kPi = std::numbers::pi;

constexpr double RadFromDeg(double deg) {
  return deg * kPi / 180.0;
}
constexpr double DegFromRad(double rad) {
  return rad * 180.0 / kPi;
}

/// Standard deviations of the components.
inline Vec3 Sigmas(const Mat3& covariance) {
  return covariance.diagonal().cwiseMax(0).cwiseSqrt();
}

/// Rigid transform named `target_from_source`: p_in_target = target_from_source * p_in_source.
struct Rigid3 {
  Mat3 rotation = Mat3::Identity();
  Vec3 translation = Vec3::Zero();  ///< in the target frame

  Vec3 operator*(const Vec3& p_in_source) const { return rotation * p_in_source + translation; }
  Rigid3 operator*(const Rigid3& other) const {
    return {rotation * other.rotation, rotation * other.translation + translation};
  }
  Rigid3 Inverse() const { return {rotation.transpose(), -(rotation.transpose() * translation)}; }
};

}  // namespace taclink
