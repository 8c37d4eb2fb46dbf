// A camera's picture: format (gray, YUYV, MJPEG), width and height (2 bytes each, low first), then its bytes.
#include <cstdint>
#include <cstdlib>
#include <opencv2/core.hpp>

#include "sensing/capture/decode.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  constexpr size_t kHeader = 5;
  constexpr int kMostPx = 1023;  // larger ones only take longer
  if (size < kHeader) return 0;
  taclink::RawImage image;
  image.format = static_cast<taclink::PixelFormat>(data[0] % 3);
  image.width_px = (data[1] | data[2] << 8) & kMostPx;
  image.height_px = (data[3] | data[4] << 8) & kMostPx;
  image.bytes.assign(data + kHeader, data + size);
  image.valid = true;
  static taclink::GrayDecoder decoder;  // as in a server, one for all frames
  static cv::Mat gray;
  const auto decoded = decoder.Decode(image, gray);
  if (decoded.ok() ? gray.cols != image.width_px || gray.rows != image.height_px
                   : decoded.error().message.empty())
    std::abort();
  return 0;
}
