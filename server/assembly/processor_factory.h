#pragma once

#include <memory>

#include "sensing/core/link_model.h"
#include "sensing/pipeline/link_pipeline.h"
#include "server/config/config.h"
#include "server/link/link_processor.h"

namespace taclink::server {

/// What the configuration says of the link's pipeline, but for the cameras.
PipelineOptions ToPipelineOptions(const LinkConfig& link);

/// The link's pipeline, ready for its first frame. A calibration file that does not exist yet is what
/// Calibrate will write; until then the first pictures calibrate. Errors: a calibration file that can't be
/// read.
Result<std::unique_ptr<LinkProcessor>> MakeProcessor(const LinkConfig& link, const LinkModel& model);

}  // namespace taclink::server
