#pragma once

#include "server/config/options.h"

namespace taclink::server {

/// Gives the calling thread, which StartThread (sensing/core/thread_start.h) has named, its place. What the
/// system does not allow is warned of, once for each cause, with what to grant, and left out.
void SetUpThread(const RealtimeOptions& options);

}  // namespace taclink::server
