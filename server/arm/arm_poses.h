#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sensing/core/geometry.h"
#include "server/arm/arm_kinematics.h"
#include "server/arm/joint_states.h"

namespace taclink::server {

/// Where a link is fixed to the arm.
struct LinkMount {
  std::optional<size_t> frame;  ///< of the kinematics; none: the base
  Rigid3 frame_from_link = {};  ///< mm
};

/// Where a link is at an instant.
struct LinkPose {
  Rigid3 base_from_link = {};  ///< mm
  PoseValidity validity = PoseValidity::kFixed;
  int64_t distance_ns =
      0;  ///< from that instant to the nearest state of the joint that is worst off; -1: none
};

/// Where the arm's links are over time. Any thread.
class ArmPoses {
 public:
  /// All links fixed in the base.
  explicit ArmPoses(std::vector<LinkMount> mounts);
  /// `mounts` by link.
  ArmPoses(std::shared_ptr<const ArmKinematics> kinematics, std::vector<LinkMount> mounts,
           JointStateOptions options = {});

  LinkPose At(size_t link, int64_t time_ns) const;

  /// Of the kinematics' frames that have visuals, in their order. Empty without a URDF.
  std::vector<LinkPose> DrawnFrames(int64_t time_ns) const;

  struct Motion {
    LinkPose pose;
    std::vector<double> positions;  ///< by joint
  };
  /// At(link, time_ns) with the positions behind it.
  Motion MotionAt(size_t link, int64_t time_ns) const;
  /// Of a point on the link for these positions, see ArmKinematics::Jacobian; no columns without a URDF.
  ArmKinematics::Jacobian6 Jacobian(size_t link, const Vec3& p_in_base_mm,
                                    const std::vector<double>& positions) const;

  /// Name of the base frame; empty without a URDF.
  std::string base_frame() const { return kinematics_ ? kinematics_->base() : std::string(); }
  const std::vector<LinkMount>& mounts() const { return mounts_; }
  /// Null without a URDF.
  const ArmKinematics* kinematics() const { return kinematics_.get(); }
  JointStateBuffer& joints() { return joints_; }
  const JointStateBuffer& joints() const { return joints_; }

 private:
  // Constant after construction.
  const std::shared_ptr<const ArmKinematics> kinematics_;
  const std::vector<LinkMount> mounts_;  // by link

  JointStateBuffer joints_;  // has its own lock
};

}  // namespace taclink::server
