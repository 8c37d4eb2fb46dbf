#pragma once

#include "server/arm/arm.h"
#include "server/gateway/gateway.h"

namespace taclink::server {

/// Ready while at least one link measures or will soon (neither STARTING nor LOST), and somebody may call;
/// tells what is not.
Readiness CheckReadiness(const Arm& arm, const Security& security);

}  // namespace taclink::server
