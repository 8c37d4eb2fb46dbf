#pragma once

#include <string>

#include "server/config/options.h"

namespace taclink::server {

/// Names the calling thread (for top -H and gdb; 15 characters are kept) and gives it its place. What the
/// system does not allow is warned of, once for each cause, with what to grant, and left out.
void SetUpThread(const std::string& name, const RealtimeOptions& options);

}  // namespace taclink::server
