#pragma once

#include <string>
#include <vector>

namespace taclink::server {

/// How a link's threads run.
struct RealtimeOptions {
  int priority = 0;            ///< of SCHED_FIFO, 1 to 99; 0: as any thread
  std::vector<int> cpus = {};  ///< that it may run on, from 0; empty: all
};

/// Names the calling thread (for top -H and gdb; 15 characters are kept) and gives it its place. What the
/// system does not allow is warned of, once for each cause, with what to grant, and left out.
void SetUpThread(const std::string& name, const RealtimeOptions& options);

}  // namespace taclink::server
