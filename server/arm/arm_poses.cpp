#include "server/arm/arm_poses.h"

#include <algorithm>
#include <utility>

namespace taclink::server {
namespace {

// Of the joint that is worst off.
void SetValidity(const ArmKinematics& kinematics, size_t frame, const JointStateBuffer::Instant& instant,
                 LinkPose& pose) {
  for (const size_t joint : kinematics.JointsOf(frame)) {
    const PoseValidity validity = instant.validity[joint];
    const int64_t distance_ns = instant.distance_ns[joint];
    if (validity > pose.validity) {
      pose.validity = validity;
      pose.distance_ns = distance_ns;
    } else if (validity == pose.validity) {
      pose.distance_ns = std::max(pose.distance_ns, distance_ns);
    }
  }
}

}  // namespace

ArmPoses::ArmPoses(std::vector<LinkMount> mounts) : ArmPoses(nullptr, std::move(mounts)) {}

ArmPoses::ArmPoses(std::shared_ptr<const ArmKinematics> kinematics, std::vector<LinkMount> mounts,
                   JointStateOptions options)
    : kinematics_(std::move(kinematics)),
      mounts_(std::move(mounts)),
      joints_(kinematics_ ? kinematics_->joints() : std::vector<JointInfo>(), options) {}

LinkPose ArmPoses::At(size_t link, int64_t time_ns) const {
  return MotionAt(link, time_ns).pose;
}

std::vector<LinkPose> ArmPoses::DrawnFrames(int64_t time_ns) const {
  std::vector<LinkPose> poses;
  if (!kinematics_ || kinematics_->drawn_frames().empty()) return poses;
  JointStateBuffer::Instant instant;
  joints_.At(time_ns, instant);
  for (const size_t frame : kinematics_->drawn_frames()) {
    LinkPose& pose = poses.emplace_back();
    pose.base_from_link = kinematics_->BaseFromFrame(frame, instant.positions);
    SetValidity(*kinematics_, frame, instant, pose);
  }
  return poses;
}

ArmPoses::Motion ArmPoses::MotionAt(size_t link, int64_t time_ns) const {
  const LinkMount& mount = mounts_[link];
  JointStateBuffer::Instant instant;
  joints_.At(time_ns, instant);
  Motion out{.pose = {.base_from_link = mount.frame_from_link}, .positions = std::move(instant.positions)};
  if (!kinematics_ || !mount.frame) return out;
  LinkPose& pose = out.pose;
  pose.base_from_link = kinematics_->BaseFromFrame(*mount.frame, out.positions) * mount.frame_from_link;
  SetValidity(*kinematics_, *mount.frame, instant, pose);
  return out;
}

ArmKinematics::Jacobian6 ArmPoses::Jacobian(size_t link, const Vec3& p_in_base_mm,
                                            const std::vector<double>& positions) const {
  const auto joints = static_cast<Eigen::Index>(positions.size());
  const LinkMount& mount = mounts_[link];
  if (!kinematics_ || !mount.frame) return ArmKinematics::Jacobian6::Zero(6, joints);
  return kinematics_->Jacobian(*mount.frame, p_in_base_mm, positions);
}

}  // namespace taclink::server
