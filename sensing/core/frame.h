#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "sensing/core/camera_model.h"

namespace taclink {

enum class PixelFormat { kGray8, kYuyv, kMjpeg };

/// A picture as the camera sent it. The buffer is reused from frame to frame.
struct RawImage {
  PixelFormat format = PixelFormat::kGray8;
  int width_px = 0;
  int height_px = 0;
  std::vector<uint8_t> bytes;
  bool valid = false;  ///< false: this camera gave no picture for this frame
};

/// When things happened to a frame. Nanoseconds; 0: has not happened. Monotonic times are CLOCK_MONOTONIC's.
struct FrameTimes {
  int64_t exposure_monotonic_ns = 0;  ///< start of exposure of the earlier picture, from the driver
  int64_t exposure_utc_ns = 0;        ///< the same, since 1970-01-01 UTC
  int64_t received_ns = 0;            ///< both pictures are in memory
  int64_t tracked_ns = 0;             ///< markers labelled
  int64_t solved_ns = 0;              ///< forces and contacts known
  int64_t published_ns = 0;           ///< handed to the hub
};

/// What a link's cameras saw at one moment.
struct StereoFrame {
  uint64_t sequence = 0;  ///< counts exposures of this source; a gap is a frame that was not seen
  FrameTimes times;
  std::array<RawImage, kCameraCount> images;
  std::optional<double> pressure_mpa;  ///< gauge pressure inside the skin at that time; none: not measured
};

}  // namespace taclink
