#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "sensing/core/camera_model.h"
#include "tests/sensing/capture/pictures.h"
#include "tests/v4l2/emulated_camera.h"
#include "tests/v4l2/uvc_descriptors.h"

namespace taclink::testing {

inline constexpr int kRigWidthPx = 320, kRigHeightPx = 240;

/// The images of one emulated camera, shown in turn: each differs from the one before, as a sensor's noise
/// makes them differ.
class Pictures {
 public:
  Pictures(CameraId id, int rate_hz) : interval_ns_(int64_t{UvcInterval100ns(rate_hz)} * 100) {
    for (int i = 0; i < kCount; ++i) {
      cv::Mat gray = SlopePicture(kRigWidthPx, kRigHeightPx, i);
      if (id == CameraId::kBottom) cv::flip(gray, gray, 1);  // brighter to the left
      mjpeg_.push_back(EncodeJpeg(gray));
      std::vector<uint8_t> yuyv(2 * gray.total(), 128);
      for (size_t pixel = 0; pixel < gray.total(); ++pixel) yuyv[2 * pixel] = gray.data[pixel];
      gray_.push_back(gray);
      yuyv_.push_back(std::move(yuyv));
    }
  }

  const std::vector<cv::Mat>& gray() const { return gray_; }
  PictureAt Source() const {
    return [this](int64_t exposure_ns, uint8_t format) {
      const auto at = static_cast<size_t>(exposure_ns / interval_ns_) % kCount;
      return std::span<const uint8_t>((format == kUvcYuyv ? yuyv_ : mjpeg_)[at]);
    };
  }

 private:
  static constexpr int kCount = 7;
  const int64_t interval_ns_;
  std::vector<cv::Mat> gray_;
  std::vector<std::vector<uint8_t>> mjpeg_, yuyv_;
};

}  // namespace taclink::testing
