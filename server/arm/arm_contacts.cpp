#include "server/arm/arm_contacts.h"

#include <utility>

namespace taclink::server {
namespace {

constexpr double kMetresPerMm = 1e-3;

ArmContact InBase(size_t link, const Contact& contact, const Rigid3& base_from_link) {
  const Mat3& rotation = base_from_link.rotation;
  ArmContact out{.id = ArmContactId(link, contact.id),
                 .link_id = contact.id,
                 .center_mm = base_from_link * contact.center_mm,
                 .normal = rotation * contact.normal,
                 .force_n = rotation * contact.force_n,
                 .normal_force_n = contact.normal_force_n,
                 .is_ring_contact = contact.is_ring_contact,
                 .area_mm2 = contact.area_mm2};
  out.moment_nmm = out.center_mm.cross(out.force_n);
  if (contact.force_covariance_n2)
    out.force_covariance_n2 = rotation * *contact.force_covariance_n2 * rotation.transpose();
  if (contact.center_covariance_mm2)
    out.center_covariance_mm2 = rotation * *contact.center_covariance_mm2 * rotation.transpose();
  return out;
}

// The torque is f . v with v the point's velocity; it changes with the force as v, and with the place p as
// f x w, w being the joint's rotation: v = w x p + constant.
JointLoad LoadOf(const ArmContact& contact, const Eigen::Matrix<double, 6, 1>& column) {
  const Vec3 per_force = kMetresPerMm * column.head<3>();
  JointLoad out{.torque_nm = per_force.dot(contact.force_n)};
  out.variance_known = contact.force_covariance_n2.has_value() || column.isZero(0);
  if (contact.force_covariance_n2) out.variance_nm2 = per_force.dot(*contact.force_covariance_n2 * per_force);
  if (contact.center_covariance_mm2) {
    const Vec3 per_place = kMetresPerMm * contact.force_n.cross(column.tail<3>());
    out.variance_nm2 += per_place.dot(*contact.center_covariance_mm2 * per_place);
  }
  return out;
}

}  // namespace

void AddLoads(const std::vector<JointLoad>& of_link, std::vector<JointLoad>& of_arm) {
  if (of_arm.size() < of_link.size()) of_arm.resize(of_link.size());
  for (size_t i = 0; i < of_link.size(); ++i) {
    of_arm[i].torque_nm += of_link[i].torque_nm;
    of_arm[i].variance_nm2 += of_link[i].variance_nm2;
    of_arm[i].variance_known = of_arm[i].variance_known && of_link[i].variance_known;
  }
}

LinkContacts ToArm(size_t link, const LinkState& state, const ArmPoses& poses) {
  // Without a picture there is no exposure.
  const int64_t time_ns =
      state.times.exposure_monotonic_ns != 0 ? state.times.exposure_monotonic_ns : state.times.published_ns;
  const ArmPoses::Motion motion = poses.MotionAt(link, time_ns);
  LinkContacts out{.link = link,
                   .sequence = state.sequence,
                   .times = state.times,
                   .status = state.status,
                   .forces_unknown = !state.has_forces(),
                   .pose = motion.pose,
                   .contacts = {},
                   .joints = std::vector<JointLoad>(motion.positions.size())};
  for (const Contact& contact : state.contacts) {
    out.contacts.push_back(InBase(link, contact, motion.pose.base_from_link));
    const auto jacobian = poses.Jacobian(link, out.contacts.back().center_mm, motion.positions);
    std::vector<JointLoad> loads;
    for (Eigen::Index joint = 0; joint < jacobian.cols(); ++joint)
      loads.push_back(LoadOf(out.contacts.back(), jacobian.col(joint)));
    AddLoads(loads, out.joints);
  }
  return out;
}

ArmContacts::ArmContacts(const ArmPoses& poses) : poses_(poses), newest_(poses.mounts().size()) {}

std::shared_ptr<const LinkContacts> ArmContacts::Of(const Publication& publication) {
  const size_t link = publication.link();
  {
    const std::lock_guard lock(mutex_);
    const Newest& newest = newest_[link];
    if (newest.contacts && newest.order == publication.order()) return newest.contacts;
  }
  auto contacts = std::make_shared<const LinkContacts>(ToArm(link, publication.state(), poses_));
  const std::lock_guard lock(mutex_);
  Newest& newest = newest_[link];
  if (!newest.contacts || newest.order < publication.order()) newest = {publication.order(), contacts};
  return contacts;
}

}  // namespace taclink::server
