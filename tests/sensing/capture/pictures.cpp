#include "tests/sensing/capture/pictures.h"

#include <gtest/gtest.h>
#include <turbojpeg.h>

#include <fstream>
#include <iterator>
#include <opencv2/core.hpp>

namespace taclink {

cv::Mat SlopePicture(int width_px, int height_px, int seed) {
  cv::Mat picture(height_px, width_px, CV_8UC1);
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      picture.at<uint8_t>(y, x) =
          static_cast<uint8_t>((seed + 160 * x / width_px + 60 * y / height_px) % 256);
    }
  }
  return picture;
}

std::vector<uint8_t> EncodeJpeg(const cv::Mat& gray, int quality) {
  tjhandle jpeg = tjInitCompress();
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  EXPECT_EQ(tjCompress2(jpeg, gray.data, gray.cols, static_cast<int>(gray.step[0]), gray.rows, TJPF_GRAY,
                        &bytes, &size, TJSAMP_GRAY, quality, 0),
            0);
  std::vector<uint8_t> copy(bytes, bytes + size);
  tjFree(bytes);
  tjDestroy(jpeg);
  return copy;
}

void WriteBytes(const std::string& path, const std::vector<uint8_t>& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

std::vector<uint8_t> ReadBytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

int LargestDifference(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size() || a.type() != CV_8UC1 || b.type() != CV_8UC1) return 256;
  return static_cast<int>(cv::norm(a, b, cv::NORM_INF));
}

}  // namespace taclink
