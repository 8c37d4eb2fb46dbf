#pragma once

#include <memory>
#include <string>

#include "sensing/capture/frame_source.h"
#include "sensing/core/clock.h"
#include "server/link/link_processor.h"
#include "server/replay/replay_track.h"

namespace taclink::server {

/// What a link is made of whose frames come from a log.
struct ReplayLink {
  std::shared_ptr<const mcap::Reader> log;
  std::string log_name;  ///< for people
  std::string link;
  std::shared_ptr<ReplaySchedule> schedule;
};

/// Hands out a link's recorded frames when they are due, round after round (StereoFrame::recorded). Their UTC
/// times are those of then; their monotonic times are moved so that each was published when it is due now,
/// which keeps their differences. Where the log has no frames of the link for a while it says so, once a
/// second.
std::unique_ptr<FrameSource> MakeReplaySource(ReplayLink link, Clock& clock);

/// Passes on what was recorded. Tares and calibrations are refused: kFailedPrecondition.
std::unique_ptr<LinkProcessor> MakeReplayProcessor();

/// The refusal of all that would change a link.
Error PlaysLog();

}  // namespace taclink::server
