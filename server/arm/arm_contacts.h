#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "sensing/core/link_state.h"
#include "server/arm/arm_poses.h"
#include "server/hub/hub.h"

namespace taclink::server {

/// A contact as the arm sees it. Base frame.
struct ArmContact {
  uint64_t id = 0;       ///< lasts while the contact does; unique over the arm
  uint64_t link_id = 0;  ///< Contact::id
  Vec3 center_mm = Vec3::Zero();
  Vec3 normal = Vec3::Zero();
  Vec3 force_n = Vec3::Zero();     ///< what the world exerts on the skin
  Vec3 moment_nmm = Vec3::Zero();  ///< of that force about the base frame's origin
  std::optional<Mat3> force_covariance_n2 = {};
  std::optional<Mat3> center_covariance_mm2 = {};
  double normal_force_n = 0;
  bool is_ring_contact = false;
  double area_mm2 = 0;
};

/// Torque (prismatic joints: force) that contacts cause on a joint.
struct JointLoad {
  double torque_nm = 0;        ///< N m; prismatic: N
  double variance_nm2 = 0;     ///< of the contacts' forces and places; meaningless unless ...
  bool variance_known = true;  ///< ... this is set
};

/// What one link's newest state means for the arm.
struct LinkContacts {
  size_t link = 0;
  uint64_t sequence = 0;
  FrameTimes times;
  LinkStatus status = LinkStatus::kStarting;
  bool forces_unknown = true;  ///< it may be pressed; see LinkState::has_forces
  LinkPose pose;               ///< at the exposure
  std::vector<ArmContact> contacts;
  std::vector<JointLoad> joints;  ///< by joint; of this link's contacts
};

/// Ids of 40 bits keep the sum exact in a double for 8191 links.
constexpr uint64_t ArmContactId(size_t link, uint64_t link_contact_id) {
  constexpr uint64_t kBits = 40;
  return uint64_t{link} << kBits | (link_contact_id & ((uint64_t{1} << kBits) - 1));
}

/// The link's contacts in the base frame, and the torques that they cause: J^T f of each.
LinkContacts ToArm(size_t link, const LinkState& state, const ArmPoses& poses);

/// Adds the loads of one link to those of the arm, which has as many joints or, yet, none.
void AddLoads(const std::vector<JointLoad>& of_link, std::vector<JointLoad>& of_arm);

/// ToArm of what links publish, done once for all who ask. Any thread.
class ArmContacts {
 public:
  explicit ArmContacts(const ArmPoses& poses);

  std::shared_ptr<const LinkContacts> Of(const Publication& publication);

 private:
  struct Newest {
    uint64_t order = 0;
    std::shared_ptr<const LinkContacts> contacts;
  };

  // Constant after construction.
  const ArmPoses& poses_;
  std::mutex mutex_;
  // Guarded by mutex_.
  std::vector<Newest> newest_;  // by link
};

}  // namespace taclink::server
