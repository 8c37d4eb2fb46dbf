#pragma once

#include <vector>

#include "sensing/core/result.h"
#include "server/arm/arm.h"
#include "server/rpc/streams/event_stream.h"
#include "taclink/v1/events.pb.h"

namespace taclink::server {

struct EventStreamOptions {
  EventStart start;
  EventFilter filter;
};
/// `links`: by link, wanted. Errors: kInvalidArgument.
Result<EventStreamOptions> ToEventStreamOptions(const v1::StreamEventsRequest& request,
                                                std::vector<bool> links, const EventHistory& history);

/// Errors: as EventEngine::SetThresholds.
Result<void> SetThresholds(Arm& arm, size_t link, const v1::SetThresholdsRequest& request,
                           const std::string& who, v1::SetThresholdsResponse& response);

/// What an ended tare or calibration is called in the audit.
Operation ToOperation(const Result<TareSummary>& end, std::string who);
Operation ToOperation(const Result<CalibrationResult>& end, std::string who);

}  // namespace taclink::server
