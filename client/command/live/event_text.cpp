#include "client/command/live/event_text.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <chrono>
#include <map>

#include "client/command/cli/units.h"
#include "client/command/live/frame_json.h"
#include "client/cpp/taclink/values.h"
#include "sensing/core/printable.h"

namespace taclink::command {
namespace {

std::string Place(const v1::Vector3& center_m) {
  return fmt::format("({:.1f}, {:.1f}, {:.1f}) mm", center_m.x() * kMmPerMetre, center_m.y() * kMmPerMetre,
                     center_m.z() * kMmPerMetre);
}

// Protobuf's maps are in no order.
std::map<std::string, double> Sorted(const v1::OperationEvent& operation) {
  return {operation.values().begin(), operation.values().end()};
}

std::string ContactText(const v1::ContactEvent& contact) {
  if (!contact.end_reason().empty())
    return fmt::format("contact {}: {} after {:.2f} s, at most {:.3f} N", contact.contact_id(),
                       contact.end_reason(), contact.duration_s(), contact.peak_force_n());
  return fmt::format("contact {}: {:.3f} N at {}", contact.contact_id(), client::MagnitudeN(contact),
                     Place(contact.center_m()));
}

// A regulator that closes its valve refuses nothing.
const char* End(const v1::Event& event) {
  if (event.operation().accepted()) return "done";
  return event.kind() == v1::EVENT_KIND_PRESSURE_TRIP ? "valve closed" : "refused";
}

std::string OperationText(const v1::Event& event) {
  const v1::OperationEvent& operation = event.operation();
  std::string text = fmt::format("{} by {}{}", End(event), operation.who(),
                                 operation.outcome().empty() ? "" : ": " + operation.outcome());
  for (const auto& [name, value] : Sorted(operation)) text += fmt::format(" {}={:.6g}", name, value);
  return text;
}

// Of the frame, where it is not well and the event itself does not say so.
std::string FrameStatus(const v1::Event& event) {
  if (event.frame_status() == v1::LINK_STATUS_UNSPECIFIED || event.frame_status() == v1::LINK_STATUS_OK ||
      event.has_link_status())
    return "";
  std::string text = fmt::format(" ({}", client::Name(event.frame_status()));
  for (const int reason : event.frame_reasons())
    text += fmt::format(" {}", client::Name(static_cast<v1::Reason>(reason)));
  return text + ")";
}

std::string Detail(const v1::Event& event) {
  const v1::ForceLevelEvent& level = event.force_level();
  const v1::LinkStatusEvent& status = event.link_status();
  switch (event.detail_case()) {
    case v1::Event::kContact:
      return ContactText(event.contact());
    case v1::Event::kForceLevel:
      return fmt::format("{}{} -> {}: {:.3f} N at {}", level.region().empty() ? "" : level.region() + ": ",
                         client::Name(level.previous()), client::Name(level.level()), level.force_n(),
                         Place(level.center_m()));
    case v1::Event::kLinkStatus:
      return fmt::format("{} -> {}{}", client::Name(status.previous()), client::Name(status.status()),
                         status.reason().empty() ? "" : ": " + status.reason());
    case v1::Event::kOperation:
      return OperationText(event);
    case v1::Event::kDrift:
      return fmt::format("the baseline has drifted by {:.3f} mm", event.drift().drift_m() * kMmPerMetre);
    case v1::Event::kFramesLost:
      return fmt::format("{} frames are lost to the events", event.frames_lost().frames());
    case v1::Event::DETAIL_NOT_SET:
      break;
  }
  return "";
}

Json ContactDetail(const v1::Event& event) {
  const v1::ContactEvent& contact = event.contact();
  Json json = {{"frame", event.frame_sequence()},
               {"contact_id", contact.contact_id()},
               {"force_n", client::MagnitudeN(contact)},
               {"center_mm", ToJson(contact.center_m(), kMmPerMetre)},
               {"force_vector_n", ToJson(contact.force_n())},
               {"peak_force_n", contact.peak_force_n()},
               {"duration_s", contact.duration_s()}};
  if (!contact.end_reason().empty()) json["end_reason"] = contact.end_reason();
  return json;
}

Json LevelDetail(const v1::Event& event) {
  const v1::ForceLevelEvent& level = event.force_level();
  return {{"frame", event.frame_sequence()},
          {"contact_id", level.contact_id()},
          {"force_n", level.force_n()},
          {"center_mm", ToJson(level.center_m(), kMmPerMetre)},
          {"region", level.region()},
          {"level", client::Name(level.level())},
          {"previous", client::Name(level.previous())}};
}

Json DetailJson(const v1::Event& event) {
  switch (event.detail_case()) {
    case v1::Event::kContact:
      return ContactDetail(event);
    case v1::Event::kForceLevel:
      return LevelDetail(event);
    case v1::Event::kLinkStatus:
      return {{"status", client::Name(event.link_status().status())},
              {"previous", client::Name(event.link_status().previous())},
              {"reason", event.link_status().reason()}};
    case v1::Event::kOperation:
      return {{"who", event.operation().who()},
              {"accepted", event.operation().accepted()},
              {"outcome", event.operation().outcome()},
              {"values", Sorted(event.operation())}};
    case v1::Event::kDrift:
      return {{"drift_mm", event.drift().drift_m() * kMmPerMetre}};
    case v1::Event::kFramesLost:
      return {{"frames", event.frames_lost().frames()}};
    case v1::Event::DETAIL_NOT_SET:
      break;
  }
  return Json::object();
}

}  // namespace

std::string EventJson(const v1::Event& event, const std::string& run_id) {
  const auto latency = client::LatencyS(event);
  Json json = {{"sequence", event.sequence()},
               {"run_id", run_id},
               {"kind", client::Name(event.kind())},
               {"link", event.link()},
               {"raised_utc_ns", event.times().raised_utc_ns()},
               {"exposure_utc_ns", event.times().exposure_utc_ns()},
               {"latency_ms", latency ? Json(*latency * 1e3) : Json(nullptr)}};
  if (event.frame_status() != v1::LINK_STATUS_UNSPECIFIED) {
    json["frame_status"] = client::Name(event.frame_status());
    json["frame_reasons"] = Json::array();
    for (const int reason : event.frame_reasons())
      json["frame_reasons"].push_back(client::Name(static_cast<v1::Reason>(reason)));
  }
  json.update(DetailJson(event));
  return json.dump();
}

std::string EventText(const v1::Event& event) {
  const int64_t raised_utc_ns = event.times().raised_utc_ns();
  const auto seconds = static_cast<std::time_t>(raised_utc_ns / 1'000'000'000);
  const auto latency = client::LatencyS(event);
  return Printable(fmt::format("{:%H:%M:%S}.{:03}  {:<14}  {:<10}  {}{}{}", fmt::gmtime(seconds),
                               raised_utc_ns / 1'000'000 % 1000, client::Name(event.kind()),
                               event.link().empty() ? "-" : event.link(), Detail(event), FrameStatus(event),
                               latency ? fmt::format("  [{:.0f} ms]", *latency * 1e3) : ""));
}

}  // namespace taclink::command
