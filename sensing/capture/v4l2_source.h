#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>

#include "sensing/capture/frame_source.h"
#include "sensing/core/clock.h"

namespace taclink {

struct V4l2Options {
  std::array<std::string, kCameraCount> devices;  ///< top, bottom; best stable paths, /dev/v4l/by-path/...
  int width_px = 640;
  int height_px = 480;
  double frame_rate_hz = 30;
  PixelFormat format = PixelFormat::kYuyv;
  std::optional<int> exposure_100us = {};  ///< exposure time, 0.1 ms; none: the camera's own automatic
  std::optional<int> gain = {};            ///< camera's own units; none: the camera's own automatic
  int buffers = 4;                         ///< pictures each driver can hold, 4 to 32
};

/// Two cameras under Linux' V4L2, both waited for with one poll and paired by their drivers' timestamps
/// (FramePairer says how); a pair's sequence follows the top camera's count. A camera that is unplugged makes
/// Next return kUnavailable and closes both; Start opens them anew. One that only falls silent makes it
/// return kTimeout, which says which one. `clock` must be the system's: the drivers stamp with
/// CLOCK_MONOTONIC.
std::unique_ptr<FrameSource> MakeV4l2Source(V4l2Options options, Clock& clock);

}  // namespace taclink
