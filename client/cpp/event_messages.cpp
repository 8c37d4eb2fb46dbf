#include <cmath>

#include "client/cpp/messages.h"
#include "wire/enum_names.h"

namespace taclink::client {
namespace {

ForceLevel From(v1::ForceLevel level) {
  switch (level) {
    case v1::FORCE_LEVEL_NORMAL:
      return ForceLevel::kNormal;
    case v1::FORCE_LEVEL_WARNING:
      return ForceLevel::kWarning;
    case v1::FORCE_LEVEL_ALARM:
      return ForceLevel::kAlarm;
    default:
      return ForceLevel::kUnknown;
  }
}

Thresholds From(const v1::Thresholds& message) {
  return {
      .warning_n = message.warning_n(), .alarm_n = message.alarm_n(), .hysteresis_n = message.hysteresis_n()};
}

void TakeContact(const v1::ContactEvent& message, Event& event) {
  event.contact_id = message.contact_id();
  event.center_m = FromMessage(message.center_m());
  event.force_vector_n = FromMessage(message.force_n());
  event.force_n = std::hypot(event.force_vector_n[0], event.force_vector_n[1], event.force_vector_n[2]);
  event.peak_force_n = message.peak_force_n();
  event.duration_s = message.duration_s();
  event.end_reason = message.end_reason();
}

void TakeLevel(const v1::ForceLevelEvent& message, Event& event) {
  event.region = message.region();
  event.level = From(message.level());
  event.previous_level = From(message.previous());
  event.force_n = message.force_n();
  event.thresholds = From(message.thresholds());
  event.contact_id = message.contact_id();
  event.center_m = FromMessage(message.center_m());
}

void TakeDetail(const v1::Event& message, Event& event) {
  switch (message.detail_case()) {
    case v1::Event::kContact:
      return TakeContact(message.contact(), event);
    case v1::Event::kForceLevel:
      return TakeLevel(message.force_level(), event);
    case v1::Event::kLinkStatus:
      event.status = Name(FromMessage(message.link_status().status()));
      event.previous_status = Name(FromMessage(message.link_status().previous()));
      event.reason = message.link_status().reason();
      return;
    case v1::Event::kOperation:
      event.who = message.operation().who();
      event.accepted = message.operation().accepted();
      event.outcome = message.operation().outcome();
      event.values = {message.operation().values().begin(), message.operation().values().end()};
      return;
    case v1::Event::kDrift:
      event.drift_m = message.drift().drift_m();
      return;
    case v1::Event::kFramesLost:
      event.frames = message.frames_lost().frames();
      return;
    case v1::Event::DETAIL_NOT_SET:
      return;
  }
}

static_assert(static_cast<int>(EventKind::kCamera) == v1::EventKind_MAX, "EventKind misses a kind");

}  // namespace

const char* Name(BaselineOrigin origin) {
  switch (origin) {
    case BaselineOrigin::kStart:
      return "start";
    case BaselineOrigin::kCalibration:
      return "calibration";
    case BaselineOrigin::kTare:
      return "tare";
    case BaselineOrigin::kForcedTare:
      return "forced tare";
    case BaselineOrigin::kUnknown:
      break;
  }
  return "none";
}

const char* Name(ForceLevel level) {
  switch (level) {
    case ForceLevel::kNormal:
      return "normal";
    case ForceLevel::kWarning:
      return "warning";
    case ForceLevel::kAlarm:
      return "alarm";
    case ForceLevel::kUnknown:
      break;
  }
  return "unknown";
}

const char* Name(EventKind kind) {
  return wire::NamesOf<v1::EventKind>().Name(static_cast<int>(kind));
}

std::optional<EventKind> EventKindOf(const std::string& name) {
  const auto number = wire::NamesOf<v1::EventKind>().Number(name);
  if (!number) return {};
  return static_cast<EventKind>(*number);
}

Baseline FromMessage(const v1::Baseline& message) {
  const bool known =
      message.origin() > 0 && message.origin() <= static_cast<int>(BaselineOrigin::kForcedTare);
  return {.origin = known ? static_cast<BaselineOrigin>(message.origin()) : BaselineOrigin::kUnknown,
          .taken_utc_ns = message.taken_utc_ns(),
          .drift_m = message.drift_m(),
          .following = message.drift_state() == v1::DRIFT_STATE_FOLLOWING};
}

ForceLevelState FromMessage(const v1::ForceLevelState& message) {
  return {.region = message.region(),
          .thresholds = From(message.thresholds()),
          .level = From(message.level()),
          .force_n = message.force_n()};
}

Event FromMessage(const v1::Event& message) {
  Event event;
  event.sequence = message.sequence();
  event.kind =
      v1::EventKind_IsValid(message.kind()) ? static_cast<EventKind>(message.kind()) : EventKind::kUnknown;
  event.link = message.link();
  event.frame_sequence = message.frame_sequence();
  const v1::EventTimes& times = message.times();
  event.exposure_utc_ns = times.exposure_utc_ns();
  event.exposure_ns = times.exposure_ns();
  event.published_ns = times.published_ns();
  event.raised_ns = times.raised_ns();
  event.raised_utc_ns = times.raised_utc_ns();
  event.sent_utc_ns = times.sent_utc_ns();
  TakeDetail(message, event);
  return event;
}

LinkTare FromMessage(const v1::LinkTare& message) {
  return {.link = message.link(),
          .accepted = message.accepted(),
          .reason = message.reason(),
          .forced = message.forced(),
          .frames = static_cast<int>(message.frames()),
          .shift_m = message.shift_m(),
          .previous_age_s = message.previous_age_s()};
}

v1::Thresholds ToMessage(const Thresholds& thresholds) {
  v1::Thresholds message;
  message.set_warning_n(thresholds.warning_n);
  message.set_alarm_n(thresholds.alarm_n);
  message.set_hysteresis_n(thresholds.hysteresis_n);
  return message;
}

v1::TareRequest ToMessage(const TareRequest& request) {
  v1::TareRequest message;
  for (const auto& link : request.links) message.add_links(link);
  message.set_force(request.force);
  message.set_frames(static_cast<uint32_t>(request.frames));
  return message;
}

v1::StreamEventsRequest ToMessage(const EventOptions& options) {
  v1::StreamEventsRequest message;
  for (const auto& link : options.links) message.add_links(link);
  for (const EventKind kind : options.kinds)
    message.add_kinds(static_cast<v1::EventKind>(static_cast<int>(kind)));
  if (options.resume) {
    message.set_after_sequence(options.resume->after_sequence);
    message.set_run_id(options.resume->run_id);
  }
  return message;
}

}  // namespace taclink::client
