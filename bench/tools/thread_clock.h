#pragma once

#include "sensing/core/clock.h"

namespace taclink {

/// CPU time of the calling thread as the monotonic time, so that stages are timed without what else the
/// machine does.
Clock& ThreadCpuClock();

}  // namespace taclink
