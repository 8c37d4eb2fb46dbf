#pragma once

#include "sensing/core/link_model.h"
#include "server/config.h"
#include "server/link_worker.h"

namespace taclink::server {

/// The link's pipeline, ready for its first frame. Errors: a calibration file that can't be read.
Result<FrameProcessor> MakeProcessor(const LinkConfig& link, const LinkModel& model);

}  // namespace taclink::server
