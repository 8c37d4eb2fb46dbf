#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <span>

#include "sensing/core/frame.h"
#include "sensing/core/result.h"

namespace taclink {

/// No picture is wider or higher than this, px. What claims to be is refused before memory is taken for it.
inline constexpr int kMaxPictureSidePx = 8192;

struct PictureSize {
  int width_px = 0;
  int height_px = 0;
};
/// Of a JPEG picture, as its header says. Errors: kInvalidArgument (none, or a damaged header).
Result<PictureSize> JpegSize(std::span<const uint8_t> bytes);

/// Raw pictures to gray ones, 8 bits, the camera's own luma (BT.601). Used from one thread at a time.
class GrayDecoder {
 public:
  GrayDecoder();
  ~GrayDecoder();
  GrayDecoder(GrayDecoder&&) noexcept;
  GrayDecoder& operator=(GrayDecoder&&) noexcept;

  /// Writes CV_8UC1, height x width, into `gray`, whose memory it reuses when the size is the same.
  /// Errors: kInvalidArgument when the image is not valid, its bytes are too few for its size, or it is a
  /// JPEG that is damaged, cut off or of another size. `gray` then holds nothing of use.
  Result<void> Decode(const RawImage& image, cv::Mat& gray);

 private:
  struct Jpeg;
  std::unique_ptr<Jpeg> jpeg_;
};

}  // namespace taclink
