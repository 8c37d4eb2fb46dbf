#include "client/command/live/contacts_view.h"

#include <fmt/format.h>

#include <algorithm>

#include "client/command/cli/units.h"
#include "client/command/live/frame_json.h"
#include "client/cpp/taclink/values.h"

namespace taclink::command {
namespace {

Json ArmContactJson(const v1::ArmContact& contact) {
  return {{"id", contact.id()},
          {"link", contact.link()},
          {"center_mm", ToJson(contact.center_m(), kMmPerMetre)},
          {"normal", ToJson(contact.normal())},
          {"force_n", ToJson(contact.wrench().force_n())},
          {"moment_nm", ToJson(contact.wrench().moment_nm())},
          {"force_sigma_n", SigmasJson(contact.force_covariance_n2(), 1)},
          {"center_sigma_mm", SigmasJson(contact.center_covariance_m2(), kMmPerMetre)},
          {"normal_force_n", contact.normal_force_n()},
          {"is_ring_contact", contact.is_ring_contact()},
          {"area_mm2", contact.area_m2() * kMm2PerSquareMetre},
          {"exposure_utc_ns", contact.exposure_utc_ns()},
          {"pose", client::Name(contact.validity())}};
}

Json LinkJson(const v1::LinkContactsStatus& link) {
  const double distance_s = link.joint_state_distance_s();
  return {{"link", link.link()},
          {"status", client::Name(link.status())},
          {"forces_unknown", link.forces_unknown()},
          {"sequence", link.sequence()},
          {"pose", client::Name(link.validity())},
          {"joint_state_distance_ms", distance_s < 0 ? Json(nullptr) : Json(distance_s * 1e3)}};
}

std::string Triple(const v1::Vector3& v, double scale, int digits) {
  return fmt::format("{:8.{}f} {:8.{}f} {:8.{}f}", v.x() * scale, digits, v.y() * scale, digits,
                     v.z() * scale, digits);
}

/// Joints whose torques are known.
int JointCount(const v1::StreamContactsResponse& arm) {
  return std::min(arm.joint_names_size(), arm.joint_torques_size());
}

bool HasSigmas(const v1::StreamContactsResponse& arm) {
  return arm.joint_torque_sigmas_size() == JointCount(arm);
}

}  // namespace

std::string ContactsJson(const v1::StreamContactsResponse& arm) {
  Json links = Json::array(), contacts = Json::array(), joints = Json::object();
  for (const v1::LinkContactsStatus& link : arm.links()) links.push_back(LinkJson(link));
  for (const v1::ArmContact& contact : arm.contacts()) contacts.push_back(ArmContactJson(contact));
  for (int i = 0; i < JointCount(arm); ++i) {
    joints[arm.joint_names(i)] = {
        {"torque_nm", arm.joint_torques(i)},
        {"sigma_nm", HasSigmas(arm) ? Json(arm.joint_torque_sigmas(i)) : Json(nullptr)}};
  }
  const bool known = arm.has_total();
  const Json json = {{"sequence", arm.sequence()},
                     {"utc_ns", arm.utc_ns()},
                     {"pose", client::Name(arm.validity())},
                     {"contacts", std::move(contacts)},
                     {"total_force_n", known ? ToJson(arm.total().force_n()) : Json(nullptr)},
                     {"total_moment_nm", known ? ToJson(arm.total().moment_nm()) : Json(nullptr)},
                     {"joints", std::move(joints)},
                     {"links", std::move(links)}};
  return json.dump();
}

std::string ContactsTable(const v1::StreamContactsResponse& arm) {
  std::string out = fmt::format("{:<14} {:<16} {:>26}  {:>26}  {:>6}  {}\n", "ID", "LINK",
                                "PLACE mm, BASE FRAME", "FORCE N, BASE FRAME", "PUSH N", "POSE");
  for (const v1::ArmContact& contact : arm.contacts()) {
    out += fmt::format("{:<14} {:<16} {}  {}  {:>6.2f}  {}\n", contact.id(), contact.link(),
                       Triple(contact.center_m(), kMmPerMetre, 1), Triple(contact.wrench().force_n(), 1, 2),
                       contact.normal_force_n(), client::Name(contact.validity()));
  }
  std::string unknown;
  for (const v1::LinkContactsStatus& link : arm.links()) {
    if (link.forces_unknown()) unknown += (unknown.empty() ? "" : ", ") + link.link();
  }
  if (!unknown.empty()) out += "FORCES NOT KNOWN: " + unknown + "\n";
  if (arm.contacts().empty() && unknown.empty()) out += "no contacts\n";
  if (JointCount(arm) == 0) return out;
  out += "JOINT TORQUES Nm (N):";
  for (int i = 0; i < JointCount(arm); ++i) {
    out += fmt::format("  {} {:.3f}", arm.joint_names(i), arm.joint_torques(i));
    if (HasSigmas(arm)) out += fmt::format(" ±{:.3f}", arm.joint_torque_sigmas(i));
  }
  return out + "\n";
}

}  // namespace taclink::command
