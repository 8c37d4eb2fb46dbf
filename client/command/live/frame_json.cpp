#include "client/command/live/frame_json.h"

#include "client/command/cli/json.h"
#include "client/command/cli/units.h"

namespace taclink::command {

Json SigmasJson(const std::optional<client::Covariance3>& covariance, double scale) {
  return covariance ? ToJson(client::Sigmas(*covariance), scale) : Json(nullptr);
}

namespace {

Json ContactJson(const client::Contact& contact) {
  return {{"id", contact.id},
          {"center_mm", ToJson(contact.center_m, kMmPerMetre)},
          {"normal", contact.normal},
          {"force_n", contact.force_n},
          {"force_sigma_n", SigmasJson(contact.force_covariance_n2, 1)},
          {"center_sigma_mm", SigmasJson(contact.center_covariance_m2, kMmPerMetre)},
          {"normal_force_n", contact.normal_force_n},
          {"is_ring_contact", contact.is_ring_contact},
          {"area_mm2", contact.area_m2 * kMm2PerSquareMetre},
          {"moment_nm", contact.moment_nm},
          {"peak_pressure_kpa", contact.peak_pressure_pa * kKpaPerPascal},
          {"outline_mm", ToJson(contact.outline_m, kMmPerMetre)},
          {"major_axis_mm", ToJson(contact.major_axis_m, kMmPerMetre)},
          {"minor_axis_mm", ToJson(contact.minor_axis_m, kMmPerMetre)}};
}

Json PressureJson(const client::PressureReport& pressure) {
  return {{"kpa", pressure.pressure_pa * kKpaPerPascal},
          {"origin", pressure.origin},
          {"assumed", pressure.assumed},
          {"stale", pressure.stale},
          {"age_s", pressure.age_s ? Json(*pressure.age_s) : Json(nullptr)},
          {"trouble", pressure.trouble}};
}

// The pressure and its standard deviation.
Json EstimateJson(const std::optional<client::PressureEstimate>& estimate) {
  if (!estimate) return nullptr;
  return Json::array({estimate->pressure_pa * kKpaPerPascal, estimate->sigma_pa * kKpaPerPascal});
}

}  // namespace

std::string FrameJson(const client::Frame& frame) {
  Json reasons = Json::array();
  for (const auto& reason : frame.status_reasons)
    reasons.push_back({{"id", reason.id},
                       {"text", reason.text},
                       {"value", reason.value ? Json(*reason.value) : Json(nullptr)},
                       {"limit", reason.limit ? Json(*reason.limit) : Json(nullptr)},
                       {"unit", reason.unit}});
  const auto latency = frame.latency_s();
  Json contacts = Json::array();
  for (const auto& contact : frame.contacts) contacts.push_back(ContactJson(contact));
  Json json = {
      {"link", frame.link},
      {"sequence", frame.sequence},
      {"exposure_utc_ns", frame.times.exposure_utc_ns},
      {"latency_ms", latency ? Json(*latency * 1e3) : Json(nullptr)},
      {"status", client::Name(frame.status)},
      {"reason", frame.status_reason},
      {"reasons", std::move(reasons)},
      {"pressure_kpa", frame.pressure_pa ? Json(*frame.pressure_pa * kKpaPerPascal) : Json(nullptr)},
      {"pressure", PressureJson(frame.pressure)},
      {"pressure_estimate_kpa", EstimateJson(frame.pressure_estimate)},
      {"force_model", client::Name(frame.force_model)},
      {"markers", {{"seen", frame.markers_seen}, {"inferred", frame.markers_inferred}}},
      {"tracked", frame.tracked},
      {"picture_share", frame.picture_share},
      {"unchanged", frame.unchanged},
      {"replayed", frame.replayed},
      {"contacts", std::move(contacts)},
      {"total_force_n", frame.total_force_n ? Json(*frame.total_force_n) : Json(nullptr)},
      {"detection_limit_n", frame.detection_limit_n ? Json(*frame.detection_limit_n) : Json(nullptr)},
      {"detection_limit_around_n",
       frame.detection_limit_around_n ? Json(*frame.detection_limit_around_n) : Json(nullptr)},
      {"force_residual", frame.force_residual ? Json(*frame.force_residual) : Json(nullptr)},
      {"camera_shift_mm", frame.camera_shift_m ? Json(*frame.camera_shift_m * kMmPerMetre) : Json(nullptr)}};
  if (!frame.positions_m.empty()) json["positions_mm"] = ToJson(frame.positions_m, kMmPerMetre);
  if (!frame.displacements_m.empty()) json["displacements_mm"] = ToJson(frame.displacements_m, kMmPerMetre);
  if (!frame.nodal_forces_n.empty()) json["nodal_forces_n"] = ToJson(frame.nodal_forces_n, 1);
  return json.dump();
}

}  // namespace taclink::command
