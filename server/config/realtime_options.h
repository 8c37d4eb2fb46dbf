#pragma once

#include <vector>

namespace taclink::server {

/// How a link's threads run.
struct RealtimeOptions {
  int priority = 0;            ///< of SCHED_FIFO, 1 to 99; 0: as any thread
  std::vector<int> cpus = {};  ///< that it may run on, from 0; empty: all
};

}  // namespace taclink::server
