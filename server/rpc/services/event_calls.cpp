#include "server/rpc/services/event_calls.h"

#include <string>
#include <utility>

#include "server/messages/event_message.h"
#include "wire/units.h"

namespace taclink::server {

Result<EventStreamOptions> ToEventStreamOptions(const v1::StreamEventsRequest& request,
                                                std::vector<bool> links, const EventHistory& history) {
  EventStreamOptions options{.start = {}, .filter = {.links = std::move(links)}};
  options.filter.all_kinds = request.kinds().empty();
  for (const int kind : request.kinds()) {
    if (kind == v1::EVENT_KIND_UNSPECIFIED || !v1::EventKind_IsValid(kind))
      return Error{ErrorCode::kInvalidArgument,
                   "kinds has " + std::to_string(kind) + ", which is not a kind of event"};
    options.filter.kinds[static_cast<size_t>(kind) - 1] = true;
  }
  const auto after =
      request.has_after_sequence() ? std::optional(request.after_sequence()) : std::optional<uint64_t>();
  const auto start = FindStart(history, after, request.run_id());
  if (!start) return start.error();
  options.start = *start;
  return options;
}

Result<void> SetThresholds(Arm& arm, size_t link, const v1::SetThresholdsRequest& request,
                           const std::string& who, v1::SetThresholdsResponse& response) {
  EventEngine& events = arm.events();
  if (auto set = events.SetThresholds(link, request.region(), FromWire(request.thresholds()), who); !set)
    return set;
  for (const LevelReport& report : events.Levels(link)) {
    if (report.region == request.region()) Fill(report, events.link(link).rules, *response.mutable_state());
  }
  return {};
}

Operation ToOperation(const Result<TareSummary>& end, std::string who) {
  if (!end) return {.who = std::move(who), .accepted = false, .outcome = end.error().message, .values = {}};
  return {.who = std::move(who),
          .accepted = true,
          .outcome = end->undone   ? "undone"
                     : end->forced ? "forced"
                                   : "",
          .values = {{"frames", end->frames},
                     {"shift_m", end->shift_mm * wire::kMetresPerMm},
                     {"previous_age_s", end->previous_age_s}}};
}

Operation ToOperation(const Result<CalibrationResult>& end, std::string who) {
  if (!end) return {.who = std::move(who), .accepted = false, .outcome = end.error().message, .values = {}};
  return {.who = std::move(who),
          .accepted = true,
          .outcome = end->saved_to.empty() ? "" : "saved to " + end->saved_to,
          .values = {{"markers_used", end->markers_used}, {"rms_px", end->rms_px}}};
}

}  // namespace taclink::server
