#pragma once

namespace taclink {

/// How a simulated scene's time advances.
enum class ScenePace {
  /// With the frames that the caller takes: on a slow machine the scene slows down and nothing is skipped.
  kFrames,
  /// With the clock, as in front of real cameras: a late caller skips to the newest frame.
  kClock,
};

}  // namespace taclink
