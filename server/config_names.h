#pragma once

#include <array>
#include <string_view>

#include "sensing/core/frame.h"

namespace taclink::server {

// Words of the configuration file, shared by its reader and its writer.
inline constexpr int kConfigVersion = 1;
inline constexpr std::array<std::string_view, 3> kSourceNames = {"v4l2", "files",
                                                                 "simulated"};  // as SourceConfig
inline constexpr std::array<std::string_view, 2> kFormatNames = {"yuyv", "mjpeg"};
inline constexpr std::array<PixelFormat, 2> kCameraFormats = {PixelFormat::kYuyv, PixelFormat::kMjpeg};

/// "auto", then as kForceModels.
inline constexpr std::array<std::string_view, 5> kForceModelNames = {"auto", "literal", "linear",
                                                                     "pressurised", "nonlinear"};

}  // namespace taclink::server
