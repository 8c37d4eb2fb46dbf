#pragma once

#include <turbojpeg.h>

#include <fstream>
#include <iterator>
#include <opencv2/core/mat.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace taclink {

/// A JPEG file's brightness, CV_8UC1. Throws when it can't be read: tests want to stop then.
inline cv::Mat ReadJpegGray(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::vector<unsigned char> bytes((std::istreambuf_iterator<char>(file)), {});
  const tjhandle decoder = tjInitDecompress();
  int width = 0, height = 0, subsampling = 0, colorspace = 0;
  cv::Mat gray;
  bool good = tjDecompressHeader3(decoder, bytes.data(), bytes.size(), &width, &height, &subsampling,
                                  &colorspace) == 0;
  if (good) {
    gray.create(height, width, CV_8UC1);
    good = tjDecompress2(decoder, bytes.data(), bytes.size(), gray.data, width, 0, height, TJPF_GRAY, 0) == 0;
  }
  tjDestroy(decoder);
  if (!good) throw std::runtime_error("cannot read " + path);
  return gray;
}

}  // namespace taclink
