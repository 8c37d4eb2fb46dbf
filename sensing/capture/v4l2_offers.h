#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace taclink {

/// What a V4L2 camera says it can do, in words for an error message. `fd` is the open device.

/// "YUYV 640x480 320x240, MJPG 1280x720". Formats that this program can read come first; long lists are cut.
std::string OfferedFormats(int fd);

/// One picture size of one format.
struct CameraOffer {
  std::string format;     ///< "YUYV", "MJPG", ...
  bool readable = false;  ///< by this program
  std::string size;       ///< "640x480", or a range "2x2 to 640x480"
  std::string rates;      ///< "30, 15, 7.5"; empty for a range of sizes
};
std::vector<CameraOffer> ListOffers(int fd);

/// "30, 15, 7.5" at that format (its V4L2 code) and size.
std::string OfferedRates(int fd, uint32_t four_cc, int width_px, int height_px);

/// Without needless decimals.
std::string RateText(double rate_hz);

}  // namespace taclink
