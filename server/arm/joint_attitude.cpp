#include "server/arm/joint_attitude.h"

#include <Eigen/Geometry>
#include <array>
#include <cmath>

namespace taclink::server {
namespace {

constexpr int64_t kStepNs = 50'000'000;  // shorter, and the noise of encoders counts
constexpr double kStepS = 1e-9 * kStepNs;
constexpr double kAccelerationShare = 0.3;  // of the acceleration, that differences do not show
constexpr double kMetersPerMm = 1e-3;
constexpr double kNoHistoryMps2 = 1;  // standard deviation while there are no joint states of a moment ago

class JointAttitude final : public AttitudeSource {
 public:
  JointAttitude(const ArmPoses& poses, size_t link, const JointAttitudeOptions& options)
      : poses_(poses), link_(link), options_(options) {}

  void Apply(StereoFrame& frame) override {
    const int64_t time_ns = frame.times.exposure_monotonic_ns;
    const LinkPose now = poses_.At(link_, time_ns);
    if (!IsCurrent(now)) {
      frame.specific_force = UnknownSpecificForce(
          AttitudeOrigin::kJointStates,
          now.validity == PoseValidity::kUnknown
              ? "the joint states of the link's joints are missing: send them (UpdateJointStates)"
              : "the joint states of the link's joints are stale: send them more often (UpdateJointStates)");
      return;
    }
    const Motion motion = MotionAt(time_ns, now);
    const double variance =
        options_.sigma_mps2 * options_.sigma_mps2 + motion.unknown_mps2 * motion.unknown_mps2;
    frame.specific_force = {
        .mps2 = now.base_from_link.rotation.transpose() * (options_.gravity_mps2 - motion.acceleration_mps2),
        .covariance = variance * Mat3::Identity(),
        .origin = AttitudeOrigin::kJointStates};
  }

 private:
  struct Motion {
    Vec3 acceleration_mps2 = Vec3::Zero();  // of the center, base frame
    double unknown_mps2 = 0;                // standard deviation
  };

  static bool IsCurrent(const LinkPose& pose) {
    return pose.validity != PoseValidity::kStale && pose.validity != PoseValidity::kUnknown;
  }

  Motion MotionAt(int64_t time_ns, const LinkPose& now) const {
    if (now.validity == PoseValidity::kFixed) return {};
    // Positions that are held since the newest joint state would look like a sudden stop.
    const int64_t held_ns = now.validity == PoseValidity::kExtrapolated ? now.distance_ns : 0;
    const LinkPose last = poses_.At(link_, time_ns - held_ns),
                   before = poses_.At(link_, time_ns - held_ns - kStepNs),
                   first = poses_.At(link_, time_ns - held_ns - 2 * kStepNs);
    if (!IsCurrent(before) || !IsCurrent(first)) return {.unknown_mps2 = kNoHistoryMps2};
    const auto center = [&](const LinkPose& pose) { return pose.base_from_link * options_.center_mm; };
    Motion motion;
    motion.acceleration_mps2 =
        kMetersPerMm / (kStepS * kStepS) * (center(last) - 2 * center(before) + center(first));
    const auto turn = [](const LinkPose& from, const LinkPose& to) {
      const Eigen::AngleAxisd by(to.base_from_link.rotation * from.base_from_link.rotation.transpose());
      return Vec3(by.angle() / kStepS * by.axis());
    };
    const Vec3 speed = turn(before, last), speed_before = turn(first, before);
    // Centripetal and tangential, from the center to a point of the link: L / sqrt(12) away, root mean
    // square.
    const double along_m = kMetersPerMm * options_.length_mm / std::sqrt(12.0);
    const double varies = along_m * (speed.squaredNorm() + (speed - speed_before).norm() / kStepS);
    const double turned = speed.norm() * 1e-9 * static_cast<double>(held_ns) * options_.gravity_mps2.norm();
    motion.unknown_mps2 = std::hypot(kAccelerationShare * motion.acceleration_mps2.norm(), varies, turned);
    return motion;
  }

  const ArmPoses& poses_;
  const size_t link_;
  const JointAttitudeOptions options_;
};

}  // namespace

std::unique_ptr<AttitudeSource> MakeJointAttitude(const ArmPoses& poses, size_t link,
                                                  const JointAttitudeOptions& options) {
  return std::make_unique<JointAttitude>(poses, link, options);
}

}  // namespace taclink::server
