#pragma once

#include <memory>

#include "sensing/core/clock.h"
#include "server/arm.h"
#include "server/config.h"

namespace taclink::server {

/// Builds the configured arm, not started. Errors name the link.
Result<std::unique_ptr<Arm>> BuildArm(const Config& config, Clock& clock);

}  // namespace taclink::server
