#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace taclink {

/// A smooth gray picture, brighter to the right and, less so, downwards; `seed` shifts it.
cv::Mat SlopePicture(int width_px, int height_px, int seed = 0);

std::vector<uint8_t> EncodeJpeg(const cv::Mat& gray, int quality = 95);
void WriteBytes(const std::string& path, const std::vector<uint8_t>& bytes);
std::vector<uint8_t> ReadBytes(const std::string& path);

/// The largest difference of two gray pictures, which must have one size.
int LargestDifference(const cv::Mat& a, const cv::Mat& b);

}  // namespace taclink
