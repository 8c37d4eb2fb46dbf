#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "sensing/core/frame.h"
#include "sensing/core/result.h"

namespace taclink {

/// Picture files: PNG of any kind and JPEG, told apart by their content, not their names. All errors name the
/// file. kNotFound: is not there or can't be read; kInvalidArgument: no such picture, damaged, or larger than
/// kMaxPictureSidePx. Made for files of unknown origin.

struct ImageFileInfo {
  PixelFormat format = PixelFormat::kGray8;  ///< what ReadRawImage gives: kGray8 of a PNG, kMjpeg of a JPEG
  int width_px = 0;
  int height_px = 0;
};

/// Reads only the beginning of the file.
Result<ImageFileInfo> ReadImageInfo(const std::string& path);

/// A PNG comes decoded, a JPEG as its bytes, with the size from its header. Reuses the buffer of `image`,
/// which is not valid after an error.
Result<void> ReadRawImage(const std::string& path, RawImage& image);

/// CV_8UC1. Colours become luma (BT.601, as cv::cvtColor does), transparency lies on black, 16 bits become 8.
Result<cv::Mat> ReadGrayImage(const std::string& path);

/// `picture` is CV_8UC1 or CV_8UC3 in the order blue, green, red. Leaves no partial file behind.
Result<void> WritePng(const std::string& path, const cv::Mat& picture);

}  // namespace taclink
