#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>

#include "sensing/capture/frame_source.h"
#include "sensing/core/clock.h"

namespace taclink {

struct V4l2Options {
  std::array<std::string, kCameraCount> devices;  ///< top, bottom; named as FindCamera says
  int width_px = 640;
  int height_px = 480;
  double frame_rate_hz = 30;
  std::optional<PixelFormat> format = PixelFormat::kYuyv;  ///< none: the best a camera has at size and rate
  std::optional<int> exposure_100us = {};  ///< exposure time, 0.1 ms; none: the camera's own automatic
  std::optional<int> gain = {};            ///< camera's own units; none: the camera's own automatic
  int buffers = 4;                         ///< pictures each driver can hold, 4 to 32
};

/// Two cameras under Linux' V4L2, as MakeCameraPair describes. `clock` must be the system's: the drivers
/// stamp with CLOCK_MONOTONIC.
std::unique_ptr<FrameSource> MakeV4l2Source(V4l2Options options, Clock& clock);

}  // namespace taclink
