#pragma once

#include <Eigen/Core>
#include <cmath>

#include "sensing/core/geometry.h"

namespace taclink {

using Vec4 = Eigen::Vector4d;
using Mat4 = Eigen::Matrix4d;

inline constexpr double kStandardGravity = 9.80665;  ///< m/s^2

/// What acts on a whole skin and is measured by other means than its shape: the gauge pressure inside, and
/// the specific force, which is gravity less the link's acceleration (link frame; at rest it points to where
/// things fall).
struct KnownLoads {
  double pressure_mpa = 0;
  Vec3 specific_force_mps2 = Vec3::Zero();

  /// Pressure first, then the specific force.
  static constexpr int kCount = 4;
  Vec4 Stacked() const {
    return {pressure_mpa, specific_force_mps2.x(), specific_force_mps2.y(), specific_force_mps2.z()};
  }
  static KnownLoads FromStacked(const Vec4& stacked) { return {stacked[0], stacked.tail<3>()}; }
  bool operator==(const KnownLoads&) const = default;
};

/// Known loads with how well they are known.
struct MeasuredLoads {
  double pressure_mpa = 0, pressure_sigma_mpa = 0;
  Vec3 specific_force_mps2 = Vec3::Zero();
  Mat3 specific_force_covariance = Mat3::Zero();  ///< (m/s^2)^2; zero: it is taken as exact
  /// What makes them the loads under which the elastic skin has the shape of one that creeps (CreepHistory):
  /// they are the measured ones and this. As KnownLoads::Stacked().
  Vec4 by_creep = Vec4::Zero();

  KnownLoads Loads() const { return {pressure_mpa, specific_force_mps2}; }
  /// As measured.
  MeasuredLoads Real() const {
    MeasuredLoads real = *this;
    real.pressure_mpa -= by_creep[0];
    real.specific_force_mps2 -= by_creep.tail<3>();
    real.by_creep.setZero();
    return real;
  }
  /// Of a link that rests in any attitude: gravity of any direction, so that each component has a third of
  /// its square.
  void ForgetAttitude() {
    specific_force_mps2.setZero();
    specific_force_covariance = kStandardGravity * kStandardGravity / 3 * Mat3::Identity();
  }
};

}  // namespace taclink
