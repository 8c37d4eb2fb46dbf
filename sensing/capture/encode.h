#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "sensing/core/result.h"

namespace taclink {

/// Gray pictures to JPEG, for people to look at. Used from one thread at a time.
class JpegEncoder {
 public:
  JpegEncoder();
  ~JpegEncoder();

  /// `gray` is CV_8UC1, `quality` 1 to 100. `bytes`' memory is reused. Errors: kInvalidArgument.
  Result<void> Encode(const cv::Mat& gray, int quality, std::vector<uint8_t>& bytes);

 private:
  struct Turbo;
  std::unique_ptr<Turbo> turbo_;
};

}  // namespace taclink
