#pragma once

#include "server/gateway/metrics_text.h"

namespace taclink::server {

/// CPU time, memory, threads and files of this process, by Prometheus' usual names. What /proc does not tell
/// is left out.
void AddProcessMetrics(MetricsText& metrics);

}  // namespace taclink::server
