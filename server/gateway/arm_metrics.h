#pragma once

#include "server/arm/arm.h"
#include "server/gateway/metrics_text.h"

namespace taclink::server {

/// How each link does: frames, latencies, status; and what waits for subscribers.
void AddArmMetrics(const Arm& arm, MetricsText& metrics);

}  // namespace taclink::server
