#pragma once

#include <array>
#include <string>
#include <string_view>

#include "sensing/core/frame.h"

namespace taclink::server {

// Words of the configuration file, shared by its reader and its writer.
inline constexpr int kConfigVersion = 1;
inline constexpr std::array<std::string_view, 3> kSourceNames = {"v4l2", "files",
                                                                 "simulated"};      // as SourceConfig
inline constexpr std::array<std::string_view, 2> kPaceNames = {"frames", "clock"};  // as ScenePace
/// "auto", then as kCameraFormats.
inline constexpr std::array<std::string_view, 4> kFormatNames = {"auto", "yuyv", "mjpeg", "grey"};
inline constexpr std::array<PixelFormat, 3> kCameraFormats = {PixelFormat::kYuyv, PixelFormat::kMjpeg,
                                                              PixelFormat::kGray8};

/// For a text value; a name like "1" or "no" must stay a text.
std::string Quoted(const std::string& text);

/// "auto", then as kForceModels.
inline constexpr std::array<std::string_view, 5> kForceModelNames = {"auto", "literal", "linear",
                                                                     "pressurised", "nonlinear"};

}  // namespace taclink::server
