#include "client/command/live/event_text.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <chrono>

#include "client/command/cli/json.h"
#include "client/command/cli/units.h"
#include "sensing/core/printable.h"

namespace taclink::command {
namespace {

using client::EventKind;

bool IsContact(EventKind kind) {
  return kind == EventKind::kContactBegin || kind == EventKind::kContactUpdate ||
         kind == EventKind::kContactEnd;
}

bool IsOperation(EventKind kind) {
  return kind == EventKind::kTare || kind == EventKind::kCalibration || kind == EventKind::kBaseline ||
         kind == EventKind::kThresholds || kind == EventKind::kRecording || kind == EventKind::kForceModel ||
         kind == EventKind::kCamera;
}

std::string Place(const client::Event& event) {
  return fmt::format("({:.1f}, {:.1f}, {:.1f}) mm", event.center_m[0] * kMmPerMetre,
                     event.center_m[1] * kMmPerMetre, event.center_m[2] * kMmPerMetre);
}

std::string Detail(const client::Event& event) {
  switch (event.kind) {
    case EventKind::kContactBegin:
    case EventKind::kContactUpdate:
      return fmt::format("contact {}: {:.3f} N at {}", event.contact_id, event.force_n, Place(event));
    case EventKind::kContactEnd:
      return fmt::format("contact {}: {} after {:.2f} s, at most {:.3f} N", event.contact_id,
                         event.end_reason, event.duration_s, event.peak_force_n);
    case EventKind::kForceLevel:
      return fmt::format("{}{} -> {}: {:.3f} N at {}", event.region.empty() ? "" : event.region + ": ",
                         client::Name(event.previous_level), client::Name(event.level), event.force_n,
                         Place(event));
    case EventKind::kLinkStatus:
      return fmt::format("{} -> {}{}", event.previous_status, event.status,
                         event.reason.empty() ? "" : ": " + event.reason);
    case EventKind::kDrift:
      return fmt::format("the baseline has drifted by {:.3f} mm", event.drift_m * kMmPerMetre);
    case EventKind::kFramesLost:
      return fmt::format("{} frames are lost to the events", event.frames);
    default:
      break;
  }
  std::string text = fmt::format("{} by {}{}", event.accepted ? "done" : "refused", event.who,
                                 event.outcome.empty() ? "" : ": " + event.outcome);
  for (const auto& [name, value] : event.values) text += fmt::format(" {}={:.6g}", name, value);
  return text;
}

}  // namespace

std::string EventJson(const client::Event& event, const std::string& run_id) {
  const auto latency = event.latency_s();
  Json json = {{"sequence", event.sequence},
               {"run_id", run_id},
               {"kind", client::Name(event.kind)},
               {"link", event.link},
               {"raised_utc_ns", event.raised_utc_ns},
               {"exposure_utc_ns", event.exposure_utc_ns},
               {"latency_ms", latency ? Json(*latency * 1e3) : Json(nullptr)}};
  if (IsContact(event.kind) || event.kind == EventKind::kForceLevel) {
    json["frame"] = event.frame_sequence;
    json["contact_id"] = event.contact_id;
    json["force_n"] = event.force_n;
    json["center_mm"] = ToJson(event.center_m, kMmPerMetre);
  }
  if (IsContact(event.kind)) {
    json["force_vector_n"] = ToJson(event.force_vector_n, 1);
    json["peak_force_n"] = event.peak_force_n;
    json["duration_s"] = event.duration_s;
    if (event.kind == EventKind::kContactEnd) json["end_reason"] = event.end_reason;
  } else if (event.kind == EventKind::kForceLevel) {
    json["region"] = event.region;
    json["level"] = client::Name(event.level);
    json["previous"] = client::Name(event.previous_level);
  } else if (event.kind == EventKind::kLinkStatus) {
    json["status"] = event.status;
    json["previous"] = event.previous_status;
    json["reason"] = event.reason;
  } else if (IsOperation(event.kind)) {
    json["who"] = event.who;
    json["accepted"] = event.accepted;
    json["outcome"] = event.outcome;
    json["values"] = Json(event.values);
  } else if (event.kind == EventKind::kDrift) {
    json["drift_mm"] = event.drift_m * kMmPerMetre;
  } else if (event.kind == EventKind::kFramesLost) {
    json["frames"] = event.frames;
  }
  return json.dump();
}

std::string EventText(const client::Event& event) {
  const auto seconds = static_cast<std::time_t>(event.raised_utc_ns / 1'000'000'000);
  const auto latency = event.latency_s();
  return Printable(fmt::format("{:%H:%M:%S}.{:03}  {:<14}  {:<10}  {}{}", fmt::gmtime(seconds),
                               event.raised_utc_ns / 1'000'000 % 1000, client::Name(event.kind),
                               event.link.empty() ? "-" : event.link, Detail(event),
                               latency ? fmt::format("  [{:.0f} ms]", *latency * 1e3) : ""));
}

}  // namespace taclink::command
