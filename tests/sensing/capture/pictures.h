#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

namespace taclink {

/// A folder that goes with its test.
class TemporaryFolder {
 public:
  TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder();

  std::string operator/(const std::string& name) const { return (path_ / name).string(); }
  std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

/// A smooth gray picture, brighter to the right and, less so, downwards; `seed` shifts it.
cv::Mat SlopePicture(int width_px, int height_px, int seed = 0);

std::vector<uint8_t> EncodeJpeg(const cv::Mat& gray, int quality = 95);
void WriteBytes(const std::string& path, const std::vector<uint8_t>& bytes);
std::vector<uint8_t> ReadBytes(const std::string& path);

/// The largest difference of two gray pictures, which must have one size.
int LargestDifference(const cv::Mat& a, const cv::Mat& b);

}  // namespace taclink
