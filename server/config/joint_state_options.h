#pragma once

#include <chrono>
#include <cstddef>

namespace taclink::server {

struct JointStateOptions {
  /// So far beyond the newest state the motion is continued.
  std::chrono::milliseconds extrapolate{50};
  /// Farther than this from any state the position is stale; also between two states.
  std::chrono::milliseconds stale_after{200};
  size_t capacity = 2048;  ///< states kept of each joint
};

}  // namespace taclink::server
