#include "client/command/live/frame_json.h"

#include <algorithm>
#include <cmath>

#include "client/command/cli/units.h"
#include "client/cpp/taclink/values.h"

namespace taclink::command {
namespace {

Json NumberOrNull(bool known, double value) {
  return known ? Json(value) : Json(nullptr);
}

Json PointsJson(const google::protobuf::RepeatedField<float>& numbers, double scale) {
  return ToJson(client::Points(numbers), scale);
}

Json ContactJson(const v1::Contact& contact) {
  return {{"id", contact.id()},
          {"center_mm", ToJson(contact.center_m(), kMmPerMetre)},
          {"normal", ToJson(contact.normal())},
          {"force_n", ToJson(contact.force_n())},
          {"force_sigma_n", SigmasJson(contact.force_covariance_n2(), 1)},
          {"center_sigma_mm", SigmasJson(contact.center_covariance_m2(), kMmPerMetre)},
          {"normal_force_n", contact.normal_force_n()},
          {"is_ring_contact", contact.is_ring_contact()},
          {"area_mm2", contact.area_m2() * kMm2PerSquareMetre},
          {"moment_nm", ToJson(contact.moment_nm())},
          {"peak_pressure_kpa", contact.peak_pressure_pa() * kKpaPerPascal},
          {"outline_mm", PointsJson(contact.outline_m(), kMmPerMetre)},
          {"major_axis_mm", ToJson(contact.major_axis_m(), kMmPerMetre)},
          {"minor_axis_mm", ToJson(contact.minor_axis_m(), kMmPerMetre)}};
}

Json PressureJson(const v1::PressureReport& pressure) {
  return {{"kpa", pressure.pressure_pa() * kKpaPerPascal},
          {"origin", client::Name(pressure.origin())},
          {"assumed", pressure.assumed() || pressure.origin() == v1::PRESSURE_ORIGIN_UNSPECIFIED},
          {"stale", pressure.stale()},
          {"age_s", NumberOrNull(pressure.has_age_s(), pressure.age_s())},
          {"trouble", pressure.trouble()}};
}

// The pressure and its standard deviation.
Json EstimateJson(const v1::LinkFrame& frame) {
  if (!frame.has_pressure_estimate()) return nullptr;
  const v1::PressureEstimate& estimate = frame.pressure_estimate();
  return Json::array({estimate.pressure_pa() * kKpaPerPascal, estimate.sigma_pa() * kKpaPerPascal});
}

// Of the upper triangle of a covariance, the diagonal's roots.
Json SigmasJson(const google::protobuf::RepeatedField<double>& covariance) {
  Json sigmas = Json::array();
  for (const int entry : {0, 3, 5}) {
    if (entry < covariance.size()) sigmas.push_back(std::sqrt(std::max(covariance[entry], 0.0)));
  }
  return sigmas;
}

Json SpecificForceJson(const v1::LinkFrame& frame) {
  if (!frame.has_specific_force_estimate()) return nullptr;
  const v1::SpecificForceEstimate& estimate = frame.specific_force_estimate();
  return {{"value", ToJson(estimate.specific_force_mps2())},
          {"sigma", SigmasJson(estimate.covariance_m2_s4())}};
}

Json ReportJson(const v1::LinkFrame& frame) {
  if (!frame.has_specific_force()) return nullptr;
  const v1::SpecificForceReport& report = frame.specific_force();
  return {{"value", ToJson(report.specific_force_mps2())},
          {"sigma", SigmasJson(report.covariance_m2_s4())},
          {"origin", client::Name(report.origin())},
          {"trouble", report.trouble()}};
}

Json ReasonsJson(const v1::LinkFrame& frame) {
  Json reasons = Json::array();
  for (const v1::StatusReason& reason : frame.status_reasons())
    reasons.push_back({{"id", reason.id()},
                       {"text", reason.text()},
                       {"value", NumberOrNull(reason.has_value(), reason.value())},
                       {"limit", NumberOrNull(reason.has_limit(), reason.limit())},
                       {"unit", reason.unit()}});
  return reasons;
}

// Part of both images' pixels that were read.
double ImageShare(const v1::LinkFrame& frame) {
  double share = 0;
  for (const v1::CameraCounts& camera : frame.cameras())
    share += static_cast<double>(camera.share_read()) / frame.cameras_size();
  return share;
}

}  // namespace

Json ToJson(const v1::Vector3& vector, double scale) {
  return ToJson(client::ToArray(vector), scale);
}

Json SigmasJson(const google::protobuf::RepeatedField<double>& covariance, double scale) {
  const auto known = client::Covariance(covariance);
  return known ? ToJson(client::Sigmas(*known), scale) : Json(nullptr);
}

std::string FrameJson(const v1::LinkFrame& frame) {
  const auto latency = client::LatencyS(frame);
  Json contacts = Json::array();
  for (const v1::Contact& contact : frame.contacts()) contacts.push_back(ContactJson(contact));
  Json json = {
      {"link", frame.link()},
      {"sequence", frame.sequence()},
      {"exposure_utc_ns", frame.times().exposure_utc_ns()},
      {"latency_ms", latency ? Json(*latency * 1e3) : Json(nullptr)},
      {"status", client::Name(frame.status())},
      {"reason", frame.status_reason()},
      {"reasons", ReasonsJson(frame)},
      {"pressure_kpa", NumberOrNull(frame.has_pressure_pa(), frame.pressure_pa() * kKpaPerPascal)},
      {"pressure", PressureJson(frame.pressure())},
      {"pressure_estimate_kpa", EstimateJson(frame)},
      {"specific_force_mps2", ReportJson(frame)},
      {"specific_force_estimate_mps2", SpecificForceJson(frame)},
      {"force_model", client::Name(frame.force_model())},
      {"markers", {{"seen", frame.markers_seen()}, {"inferred", frame.markers_inferred()}}},
      {"tracked", frame.tracking_mode() == v1::TRACKING_MODE_TRACKED},
      {"picture_share", ImageShare(frame)},
      {"unchanged", frame.unchanged()},
      {"replayed", frame.replayed()},
      {"contacts", std::move(contacts)},
      {"total_force_n", frame.has_total_force_n() ? ToJson(frame.total_force_n()) : Json(nullptr)},
      {"detection_limit_n", NumberOrNull(frame.has_detection_limit_n(), frame.detection_limit_n())},
      {"detection_limit_around_n",
       NumberOrNull(frame.has_detection_limit_around_n(), frame.detection_limit_around_n())},
      {"force_residual", NumberOrNull(frame.has_force_residual(), frame.force_residual())},
      {"camera_shift_mm", NumberOrNull(frame.has_camera_shift_m(), frame.camera_shift_m() * kMmPerMetre)}};
  if (!frame.positions_m().empty()) json["positions_mm"] = PointsJson(frame.positions_m(), kMmPerMetre);
  if (!frame.displacements_m().empty())
    json["displacements_mm"] = PointsJson(frame.displacements_m(), kMmPerMetre);
  if (!frame.nodal_forces_n().empty()) json["nodal_forces_n"] = PointsJson(frame.nodal_forces_n(), 1);
  return json.dump();
}

}  // namespace taclink::command
