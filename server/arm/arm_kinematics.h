#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/core/result.h"

namespace taclink::server {

enum class JointKind { kRevolute, kContinuous, kPrismatic };

struct JointLimits {
  double lower = 0, upper = 0;  ///< rad; prismatic: m
};

/// A joint that moves by itself. Positions are rad; prismatic: m.
struct JointInfo {
  std::string name;
  JointKind kind = JointKind::kRevolute;
  std::optional<JointLimits> limits;  ///< none: the URDF gives no range
};

enum class VisualShape { kBox, kCylinder, kSphere };

/// A body that a URDF draws: a <visual>. Meshes are left out.
struct ArmVisual {
  size_t frame = 0;               ///< that it moves with
  Rigid3 frame_from_visual = {};  ///< mm
  VisualShape shape = VisualShape::kBox;
  Vec3 size_mm = Vec3::Zero();  ///< along its axes; a cylinder's axis is z
  std::optional<Vec3> color;    ///< red, green, blue, 0 to 1; none: the URDF names none
};

/// Where an arm's frames are for given joint positions, after its URDF [urdf], by KDL [kdl]. Fixed joints are
/// part of the frames, mimicking joints follow theirs. Immutable: any thread.
class ArmKinematics {
 public:
  /// Rows 0 to 2: velocity of the point, mm/s; rows 3 to 5: rotation, rad/s; both for 1 rad/s (prismatic:
  /// 1 m/s) of each joint. One column a joint. Base frame.
  using Jacobian6 = Eigen::Matrix<double, 6, Eigen::Dynamic>;

  /// `base`: the frame that stands still, all results are in it; empty: the URDF's root. Errors, with the
  /// file and what to do: kNotFound (the file, or no such base), kInvalidArgument (no valid URDF).
  static Result<std::shared_ptr<const ArmKinematics>> Load(const std::string& path,
                                                           const std::string& base = "");
  /// `name` stands for the file in messages.
  static Result<std::shared_ptr<const ArmKinematics>> Parse(const std::string& name, const std::string& xml,
                                                            const std::string& base = "");
  ~ArmKinematics();
  ArmKinematics(const ArmKinematics&) = delete;
  ArmKinematics& operator=(const ArmKinematics&) = delete;

  const std::string& base() const;
  /// From the root to the tips; positions are given in this order.
  const std::vector<JointInfo>& joints() const;
  std::optional<size_t> FindJoint(const std::string& name) const;
  /// Whether it is a joint of the URDF that has no position of its own: fixed, or mimicking another.
  bool IsDependent(const std::string& joint) const;

  const std::vector<ArmVisual>& visuals() const;
  /// Frames that have visuals, rising.
  const std::vector<size_t>& drawn_frames() const;
  const std::string& frame_name(size_t frame) const;
  /// The index of a frame (a URDF link). Errors: kNotFound, with the frames there are.
  Result<size_t> FindFrame(const std::string& name) const;
  /// Indices of the joints that move the frame against the base, mimicked ones included; rising.
  const std::vector<size_t>& JointsOf(size_t frame) const;

  /// mm. One position for each joint.
  Rigid3 BaseFromFrame(size_t frame, std::span<const double> positions) const;
  /// Of a point that moves with the frame; where it is now, base frame, mm.
  Jacobian6 Jacobian(size_t frame, const Vec3& p_in_base_mm, std::span<const double> positions) const;

 private:
  struct Parts;
  explicit ArmKinematics(std::unique_ptr<const Parts> parts);

  const std::unique_ptr<const Parts> parts_;
};

}  // namespace taclink::server
