#pragma once

#include <memory>

#include "sensing/core/clock.h"
#include "server/config/config.h"
#include "server/pressure/pressure_source.h"

namespace taclink::server {

/// The configured source of a link's pressure, not started.
std::unique_ptr<PressureSource> MakePressure(const LinkConfig& link, Clock& clock);

}  // namespace taclink::server
