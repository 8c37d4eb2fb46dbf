#include "client/command/live/contacts_view.h"

#include <fmt/format.h>

#include "client/command/cli/units.h"
#include "client/command/live/frame_json.h"

namespace taclink::command {
namespace {

Json ArmContactJson(const client::ArmContact& contact) {
  return {{"id", contact.id},
          {"link", contact.link},
          {"center_mm", ToJson(contact.center_m, kMmPerMetre)},
          {"normal", contact.normal},
          {"force_n", contact.force_n},
          {"moment_nm", contact.moment_nm},
          {"force_sigma_n", SigmasJson(contact.force_covariance_n2, 1)},
          {"center_sigma_mm", SigmasJson(contact.center_covariance_m2, kMmPerMetre)},
          {"normal_force_n", contact.normal_force_n},
          {"is_ring_contact", contact.is_ring_contact},
          {"area_mm2", contact.area_m2 * kMm2PerSquareMetre},
          {"exposure_utc_ns", contact.exposure_utc_ns},
          {"pose", client::Name(contact.validity)}};
}

std::string Triple(const client::Vector3& v, double scale, int digits) {
  return fmt::format("{:8.{}f} {:8.{}f} {:8.{}f}", v[0] * scale, digits, v[1] * scale, digits, v[2] * scale,
                     digits);
}

}  // namespace

std::string ContactsJson(const client::ArmContacts& arm) {
  Json links = Json::array(), contacts = Json::array(), joints = Json::object();
  for (const auto& link : arm.links) {
    links.push_back(
        {{"link", link.link},
         {"status", client::Name(link.status)},
         {"forces_unknown", link.forces_unknown},
         {"sequence", link.sequence},
         {"pose", client::Name(link.validity)},
         {"joint_state_distance_ms",
          link.joint_state_distance_s < 0 ? Json(nullptr) : Json(link.joint_state_distance_s * 1e3)}});
  }
  for (const auto& contact : arm.contacts) contacts.push_back(ArmContactJson(contact));
  for (const auto& joint : arm.joints) {
    joints[joint.joint] = {{"torque_nm", joint.torque_nm},
                           {"sigma_nm", joint.sigma_nm ? Json(*joint.sigma_nm) : Json(nullptr)}};
  }
  const auto sum = [](const auto& total) { return total ? Json(*total) : Json(nullptr); };
  const Json json = {{"sequence", arm.sequence},
                     {"utc_ns", arm.utc_ns},
                     {"pose", client::Name(arm.validity)},
                     {"contacts", std::move(contacts)},
                     {"total_force_n", sum(arm.total_force_n)},
                     {"total_moment_nm", sum(arm.total_moment_nm)},
                     {"joints", std::move(joints)},
                     {"links", std::move(links)}};
  return json.dump();
}

std::string ContactsTable(const client::ArmContacts& arm) {
  std::string out = fmt::format("{:<14} {:<16} {:>26}  {:>26}  {:>6}  {}\n", "ID", "LINK",
                                "PLACE mm, BASE FRAME", "FORCE N, BASE FRAME", "PUSH N", "POSE");
  for (const auto& contact : arm.contacts) {
    out += fmt::format("{:<14} {:<16} {}  {}  {:>6.2f}  {}\n", contact.id, contact.link,
                       Triple(contact.center_m, kMmPerMetre, 1), Triple(contact.force_n, 1, 2),
                       contact.normal_force_n, client::Name(contact.validity));
  }
  std::string unknown;
  for (const auto& link : arm.links) {
    if (link.forces_unknown) unknown += (unknown.empty() ? "" : ", ") + link.link;
  }
  if (!unknown.empty()) out += "FORCES NOT KNOWN: " + unknown + "\n";
  if (arm.contacts.empty() && unknown.empty()) out += "no contacts\n";
  if (arm.joints.empty()) return out;
  out += "JOINT TORQUES Nm (N):";
  for (const auto& joint : arm.joints) {
    out += fmt::format("  {} {:.3f}", joint.joint, joint.torque_nm);
    if (joint.sigma_nm) out += fmt::format(" ±{:.3f}", *joint.sigma_nm);
  }
  return out + "\n";
}

}  // namespace taclink::command
