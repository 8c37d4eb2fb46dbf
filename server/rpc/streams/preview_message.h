#pragma once

#include <cstdint>
#include <vector>

#include "sensing/capture/decode.h"
#include "sensing/capture/encode.h"
#include "sensing/core/camera_model.h"
#include "sensing/core/frame.h"
#include "taclink/v1/preview.pb.h"

namespace taclink::server {

/// Makes pictures that people can look at. Keeps its buffers; used from one thread at a time.
class PreviewMaker {
 public:
  /// All but the markers. What can't be made is told in the message.
  void Fill(const RawImage& image, CameraId camera, v1::PreviewPicture& out);

 private:
  GrayDecoder decoder_;
  JpegEncoder encoder_;
  cv::Mat gray_;
  std::vector<uint8_t> jpeg_;
};

}  // namespace taclink::server
