#include "sensing/simulation/scene_motion.h"

#include <algorithm>
#include <cmath>

#include "sensing/core/units.h"

namespace taclink {
namespace {

constexpr double kMetersPerMm = 1e-3;

}  // namespace

JointMotion Swing::At(double time_s) const {
  const double frequency = 2 * kPi / period_s;
  const double cosine = std::cos(frequency * time_s), sine = std::sin(frequency * time_s);
  return {.rad = mean_rad - amplitude_rad * cosine,
          .radps = amplitude_rad * frequency * sine,
          .radps2 = amplitude_rad * frequency * frequency * cosine};
}

Vec3 SceneMotion::SpecificForce(double time_s, const Vec3& point_mm) const {
  if (!swing) return gravity_mps2;
  return SpecificForce(swing->At(time_s), point_mm);
}

// The axis is the same in both frames, so that angular velocity and acceleration need no rotation.
Vec3 SceneMotion::SpecificForce(const JointMotion& joint, const Vec3& point_mm) const {
  if (!swing) return gravity_mps2;
  const Vec3 arm_m = kMetersPerMm * (point_mm - swing->pivot_mm);
  const Vec3 rate = joint.radps * swing->axis;
  const Vec3 acceleration = joint.radps2 * swing->axis.cross(arm_m) + rate.cross(rate.cross(arm_m));
  return Eigen::AngleAxisd(-joint.rad, swing->axis) * gravity_mps2 - acceleration;
}

double SceneMotion::MostMps2() const {
  if (!swing) return gravity_mps2.norm();
  constexpr int kSamples = 64;
  double most = 0;
  for (int i = 0; i < kSamples; ++i)
    most = std::max(most, SpecificForce(swing->period_s * i / kSamples, Vec3::Zero()).norm());
  return most;
}

}  // namespace taclink
