#pragma once

#include "server/arm.h"
#include "server/gateway/gateway.h"

namespace taclink::server {

/// Ready while at least one link measures or will soon (neither STARTING nor LOST); tells which are not.
Readiness CheckReadiness(const Arm& arm);

}  // namespace taclink::server
