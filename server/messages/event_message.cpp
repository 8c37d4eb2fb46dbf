#include "server/messages/event_message.h"

#include "wire/convert.h"
#include "wire/units.h"

namespace taclink::server {
namespace {

v1::ForceLevel ToWire(ForceLevel level) {
  switch (level) {
    case ForceLevel::kNormal:
      return v1::FORCE_LEVEL_NORMAL;
    case ForceLevel::kWarning:
      return v1::FORCE_LEVEL_WARNING;
    case ForceLevel::kAlarm:
      return v1::FORCE_LEVEL_ALARM;
  }
  return v1::FORCE_LEVEL_UNSPECIFIED;
}

// Both enums number their values in the same order, v1::EventKind from 1.
static_assert(kEventKinds == v1::EventKind_MAX, "EventKind of event.h and of events.proto differ");

struct DetailWriter {
  v1::Event& out;

  void operator()(const std::monostate&) const {}
  void operator()(const ContactDetail& contact) const {
    v1::ContactEvent& message = *out.mutable_contact();
    message.set_contact_id(contact.id);
    wire::Fill(contact.center_mm, wire::kMetresPerMm, *message.mutable_center_m());
    wire::Fill(contact.normal, 1, *message.mutable_normal());
    wire::Fill(contact.force_n, 1, *message.mutable_force_n());
    message.set_normal_force_n(contact.normal_force_n);
    message.set_peak_force_n(contact.peak_n);
    message.set_duration_s(contact.duration_s);
    message.set_end_reason(contact.end_reason);
  }
  void operator()(const ForceLevelDetail& level) const {
    v1::ForceLevelEvent& message = *out.mutable_force_level();
    message.set_region(level.region);
    message.set_level(ToWire(level.level));
    message.set_previous(ToWire(level.previous));
    message.set_force_n(level.force_n);
    Fill(level.thresholds, *message.mutable_thresholds());
    message.set_contact_id(level.contact_id);
    wire::Fill(level.center_mm, wire::kMetresPerMm, *message.mutable_center_m());
  }
  void operator()(const StatusDetail& status) const {
    v1::LinkStatusEvent& message = *out.mutable_link_status();
    message.set_status(wire::ToWire(status.status));
    message.set_previous(wire::ToWire(status.previous));
    message.set_reason(status.reason);
  }
  void operator()(const Operation& operation) const {
    v1::OperationEvent& message = *out.mutable_operation();
    message.set_who(operation.who);
    message.set_accepted(operation.accepted);
    message.set_outcome(operation.outcome);
    message.mutable_values()->insert(operation.values.begin(), operation.values.end());
  }
  void operator()(const DriftDetail& drift) const {
    out.mutable_drift()->set_drift_m(drift.drift_mm * wire::kMetresPerMm);
    out.mutable_drift()->set_step_m(drift.step_mm * wire::kMetresPerMm);
  }
  void operator()(const FramesLostDetail& lost) const { out.mutable_frames_lost()->set_frames(lost.frames); }
};

}  // namespace

void Fill(const Event& event, const std::string& link, v1::Event& out) {
  out.set_sequence(event.sequence);
  out.set_kind(static_cast<v1::EventKind>(static_cast<int>(event.kind) + 1));
  out.set_link(link);
  out.set_frame_sequence(event.frame_sequence);
  if (event.frame_status) out.set_frame_status(wire::ToWire(*event.frame_status));
  for (const ReasonId id : event.frame_reasons) out.add_frame_reasons(wire::ToWire(id));
  v1::EventTimes& times = *out.mutable_times();
  times.set_exposure_utc_ns(event.exposure_utc_ns);
  times.set_exposure_ns(event.exposure_ns);
  times.set_published_ns(event.published_ns);
  times.set_raised_ns(event.raised_ns);
  times.set_raised_utc_ns(event.raised_utc_ns);
  std::visit(DetailWriter{out}, event.detail);
}

void Fill(const Thresholds& thresholds, v1::Thresholds& out) {
  out.set_warning_n(thresholds.warning_n);
  out.set_alarm_n(thresholds.alarm_n);
  out.set_hysteresis_n(thresholds.hysteresis_n);
}

Thresholds FromWire(const v1::Thresholds& thresholds) {
  return {.warning_n = thresholds.warning_n(),
          .alarm_n = thresholds.alarm_n(),
          .hysteresis_n = thresholds.hysteresis_n()};
}

void Fill(const LevelReport& report, const LinkRules& rules, v1::ForceLevelState& out) {
  out.set_region(report.region);
  for (const Region& region : rules.regions) {
    if (region.name != report.region) continue;
    v1::MarkerRange& range = *out.mutable_markers();
    range.set_first_ring(static_cast<uint32_t>(region.first_ring));
    range.set_last_ring(static_cast<uint32_t>(region.last_ring));
    range.set_first_path(static_cast<uint32_t>(region.first_path));
    range.set_last_path(static_cast<uint32_t>(region.last_path));
  }
  Fill(report.thresholds, *out.mutable_thresholds());
  out.set_level(ToWire(report.level));
  out.set_force_n(report.force_n);
}

}  // namespace taclink::server
