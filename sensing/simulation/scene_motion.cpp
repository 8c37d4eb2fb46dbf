#include "sensing/simulation/scene_motion.h"

#include <algorithm>
#include <cmath>

#include "sensing/core/units.h"

namespace taclink {
namespace {

constexpr double kMetersPerMm = 1e-3;

double Frequency(const Swing& swing) {
  return 2 * kPi / swing.period_s;
}

}  // namespace

double Swing::AngleRad(double time_s) const {
  return mean_rad - amplitude_rad * std::cos(Frequency(*this) * time_s);
}

double Swing::RateRadps(double time_s) const {
  return amplitude_rad * Frequency(*this) * std::sin(Frequency(*this) * time_s);
}

double Swing::AccelerationRadps2(double time_s) const {
  const double frequency = Frequency(*this);
  return amplitude_rad * frequency * frequency * std::cos(frequency * time_s);
}

// The axis is the same in both frames, so that angular velocity and acceleration need no rotation.
Vec3 SceneMotion::SpecificForce(double time_s, const Vec3& point_mm) const {
  if (!swing) return gravity_mps2;
  const Vec3 arm_m = kMetersPerMm * (point_mm - swing->pivot_mm);
  const Vec3 rate = swing->RateRadps(time_s) * swing->axis;
  const Vec3 acceleration =
      swing->AccelerationRadps2(time_s) * swing->axis.cross(arm_m) + rate.cross(rate.cross(arm_m));
  return Eigen::AngleAxisd(-swing->AngleRad(time_s), swing->axis) * gravity_mps2 - acceleration;
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
