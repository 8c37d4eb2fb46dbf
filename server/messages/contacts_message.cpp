#include "server/messages/contacts_message.h"

#include <algorithm>
#include <cmath>

#include "wire/convert.h"
#include "wire/units.h"

namespace taclink::server {
namespace {

using wire::kMetresPerMm;

// In LinkContacts' order; POSE_VALIDITY_UNSPECIFIED has no like.
static_assert(static_cast<int>(PoseValidity::kFixed) + 1 == v1::POSE_VALIDITY_FIXED);
static_assert(static_cast<int>(PoseValidity::kUnknown) + 1 == v1::POSE_VALIDITY_UNKNOWN);

void FillStatus(const LinkContacts& link, v1::LinkContactsStatus& out) {
  out.set_status(wire::ToWire(link.status));
  out.set_sequence(link.sequence);
  out.set_forces_unknown(link.forces_unknown);
  wire::Fill(link.times, *out.mutable_times());
  wire::Fill(link.pose.base_from_link, *out.mutable_base_from_link());
  out.set_validity(ToWire(link.pose.validity));
  const auto distance_ns = static_cast<double>(link.pose.distance_ns);
  out.set_joint_state_distance_s(link.pose.distance_ns < 0 ? -1 : distance_ns * 1e-9);
}

void FillContact(const LinkContacts& link, const std::string& link_name, const ArmContact& contact,
                 v1::ArmContact& out) {
  out.set_id(contact.id);
  out.set_link_contact_id(contact.link_id);
  out.set_link(link_name);
  out.set_link_index(static_cast<uint32_t>(link.link));
  wire::Fill(contact.center_mm, kMetresPerMm, *out.mutable_center_m());
  wire::Fill(contact.normal, 1, *out.mutable_normal());
  wire::Fill(contact.force_n, 1, *out.mutable_wrench()->mutable_force_n());
  wire::Fill(contact.moment_nmm, kMetresPerMm, *out.mutable_wrench()->mutable_moment_nm());
  if (contact.force_covariance_n2)
    wire::FillCovariance(*contact.force_covariance_n2, 1, *out.mutable_force_covariance_n2());
  if (contact.center_covariance_mm2)
    wire::FillCovariance(*contact.center_covariance_mm2, kMetresPerMm, *out.mutable_center_covariance_m2());
  out.set_normal_force_n(contact.normal_force_n);
  out.set_is_ring_contact(contact.is_ring_contact);
  out.set_area_m2(contact.area_mm2 * wire::kSquareMetresPerMm2);
  out.set_exposure_utc_ns(link.times.exposure_utc_ns);
  out.set_validity(ToWire(link.pose.validity));
}

void FillJoints(const std::vector<JointLoad>& loads, v1::StreamContactsResponse& out) {
  bool known = true;
  for (const JointLoad& load : loads) {
    out.add_joint_torques(load.torque_nm);
    out.add_joint_torque_sigmas(std::sqrt(std::max(0.0, load.variance_nm2)));
    known = known && load.variance_known;
  }
  if (!known) out.clear_joint_torque_sigmas();
}

// All at one time, so that links and bodies which touch stay together.
void FillDrawn(const std::vector<std::shared_ptr<const LinkContacts>>& newest, const ArmPoses& poses,
               v1::StreamContactsResponse& out) {
  int64_t time_ns = 0;
  for (const auto& link : newest)
    if (link) time_ns = std::max(time_ns, link->times.exposure_monotonic_ns);
  if (time_ns == 0 || poses.kinematics() == nullptr) return;
  for (int link = 0; link < out.links_size(); ++link)
    wire::Fill(poses.At(static_cast<size_t>(link), time_ns).base_from_link,
               *out.mutable_links(link)->mutable_drawn_base_from_link());
  const std::vector<LinkPose> drawn = poses.DrawnFrames(time_ns);
  for (size_t i = 0; i < drawn.size(); ++i) {
    v1::FramePose& pose = *out.add_frame_poses();
    pose.set_frame(poses.kinematics()->frame_name(poses.kinematics()->drawn_frames()[i]));
    wire::Fill(drawn[i].base_from_link, *pose.mutable_base_from_frame());
    pose.set_validity(ToWire(drawn[i].validity));
  }
}

}  // namespace

v1::PoseValidity ToWire(PoseValidity validity) {
  return static_cast<v1::PoseValidity>(static_cast<int>(validity) + 1);
}

void Fill(const std::vector<std::shared_ptr<const LinkContacts>>& newest,
          const std::vector<std::string>& link_names, const ArmPoses& poses,
          v1::StreamContactsResponse& out) {
  out.Clear();
  const std::vector<JointInfo>& joints = poses.joints().joints();
  Vec3 force_n = Vec3::Zero(), moment_nmm = Vec3::Zero();
  std::vector<JointLoad> loads(joints.size());
  PoseValidity worst = PoseValidity::kFixed;
  for (size_t i = 0; i < newest.size(); ++i) {
    v1::LinkContactsStatus& status = *out.add_links();
    status.set_link(link_names[i]);
    status.set_status(v1::LINK_STATUS_STARTING);
    status.set_forces_unknown(true);
    if (!newest[i]) continue;
    const LinkContacts& link = *newest[i];
    FillStatus(link, status);
    if (!link.contacts.empty()) worst = std::max(worst, link.pose.validity);
    AddLoads(link.joints, loads);
    for (const ArmContact& contact : link.contacts) {
      FillContact(link, link_names[i], contact, *out.add_contacts());
      force_n += contact.force_n;
      moment_nmm += contact.moment_nmm;
    }
  }
  // A sum over nothing is no zero.
  const auto is_unknown = [](const auto& link) { return link.forces_unknown(); };
  if (!std::ranges::all_of(out.links(), is_unknown)) {
    wire::Fill(force_n, 1, *out.mutable_total()->mutable_force_n());
    wire::Fill(moment_nmm, kMetresPerMm, *out.mutable_total()->mutable_moment_nm());
    FillJoints(loads, out);
  }
  if (std::ranges::any_of(out.links(), is_unknown)) out.clear_joint_torque_sigmas();
  for (const JointInfo& joint : joints) out.add_joint_names(joint.name);
  out.set_validity(ToWire(worst));
  FillDrawn(newest, poses, out);
}

}  // namespace taclink::server
