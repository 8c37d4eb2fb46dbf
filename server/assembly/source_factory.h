#pragma once

#include <memory>

#include "sensing/capture/frame_source.h"
#include "sensing/core/clock.h"
#include "sensing/core/link_model.h"
#include "sensing/simulation/simulated_source.h"
#include "server/config/config.h"

namespace taclink::server {

/// The configured source of a link, not started. `handling`: of a simulated one. Errors: what no restart will
/// mend, a scene that is not there or does not fit the model.
Result<std::unique_ptr<FrameSource>> MakeSource(const LinkConfig& link, const LinkModel& model, Clock& clock,
                                                HandlingNow handling = nullptr);

}  // namespace taclink::server
