#include "sensing/pipeline/image_contrast.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "sensing/core/median.h"

namespace taclink {
namespace {

constexpr double kLeastContrastLevels = 10;  // at rest; less is compared with its own noise
constexpr double kLeastPart = 0.1;

// Mean brightness of 3 x 3 pixels less that on the circle; none: the circle leaves the image.
std::optional<double> ContrastAt(const cv::Mat& gray, const Vec2& center_px, double radius_px) {
  constexpr int kSamples = 16;
  const int reach = static_cast<int>(std::ceil(std::max(radius_px, 1.0)));
  const int x = static_cast<int>(std::lround(center_px.x())),
            y = static_cast<int>(std::lround(center_px.y()));
  if (x < reach || y < reach || x >= gray.cols - reach || y >= gray.rows - reach) return std::nullopt;
  int inside = 0, around = 0;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) inside += gray.at<uint8_t>(y + dy, x + dx);
  }
  for (int i = 0; i < kSamples; ++i) {
    const double angle = 2 * kPi * i / kSamples;
    around += gray.at<uint8_t>(y + static_cast<int>(std::lround(radius_px * std::sin(angle))),
                               x + static_cast<int>(std::lround(radius_px * std::cos(angle))));
  }
  return inside / 9.0 - around / static_cast<double>(kSamples);
}

}  // namespace

void ImageContrast::SetRest(const cv::Mat& gray, std::span<const MarkerObservation> markers) {
  rest_.assign(markers.size(), {});
  if (gray.empty()) return;
  for (size_t m = 0; m < markers.size(); ++m) {
    if (!markers[m].seen) continue;
    double nearest2 = 1e12;
    for (size_t other = 0; other < markers.size(); ++other) {
      if (other != m && markers[other].seen)
        nearest2 = std::min(nearest2, (markers[other].center_px - markers[m].center_px).squaredNorm());
    }
    const double radius_px = std::sqrt(nearest2) / 2;
    const auto contrast = ContrastAt(gray, markers[m].center_px, radius_px);
    if (contrast && *contrast >= kLeastContrastLevels)
      rest_[m] = {static_cast<float>(radius_px), static_cast<float>(*contrast)};
  }
}

std::optional<double> ImageContrast::Of(const cv::Mat& gray, std::span<const MarkerObservation> markers) {
  ratios_.clear();
  if (gray.empty()) return std::nullopt;
  for (size_t m = 0; m < std::min(markers.size(), rest_.size()); ++m) {
    if (!markers[m].seen || rest_[m].contrast <= 0) continue;
    if (const auto contrast = ContrastAt(gray, markers[m].center_px, static_cast<double>(rest_[m].radius_px)))
      ratios_.push_back(*contrast / static_cast<double>(rest_[m].contrast));
  }
  if (static_cast<double>(ratios_.size()) < kLeastPart * static_cast<double>(rest_.size()) || ratios_.empty())
    return std::nullopt;
  return std::max(0.0, Median(ratios_));
}

}  // namespace taclink
