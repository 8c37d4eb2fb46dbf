#include "sensing/simulation/dirt.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace taclink {

Dirt::Dirt(int width_px, int height_px, int specks, uint64_t seed) {
  std::mt19937_64 rng(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int i = 0; i < specks; ++i) {
    const bool dark = i % 2 == 0;
    const double x0 = width_px * unit(rng), y0 = height_px * unit(rng);
    const double radius = dark ? 1.5 + 5 * unit(rng) : 0.8 + 2.2 * unit(rng);
    const double strength = dark ? 0.3 + 0.6 * unit(rng) : 20 + 130 * unit(rng);
    const int reach = static_cast<int>(std::ceil(2.5 * radius));
    const int cx = static_cast<int>(x0), cy = static_cast<int>(y0);
    for (int y = std::max(0, cy - reach); y <= std::min(height_px - 1, cy + reach); ++y) {
      for (int x = std::max(0, cx - reach); x <= std::min(width_px - 1, cx + reach); ++x) {
        const double off2 = (std::pow(x - x0, 2) + std::pow(y - y0, 2)) / (radius * radius);
        const double cover = std::exp(-off2 * off2);
        if (cover < 0.02) continue;
        const auto keep = static_cast<float>(dark ? 1 - strength * cover : 1);
        const auto add = static_cast<float>(dark ? 0 : strength * cover);
        pixels_.push_back({x, y, keep, add});
      }
    }
  }
}

void Dirt::CoverLens(cv::Mat& gray) const {
  for (const Pixel& p : pixels_) {
    auto& level = gray.at<uint8_t>(p.y, p.x);
    level = static_cast<uint8_t>(std::clamp(p.keep * static_cast<float>(level) + p.add + 0.5F, 0.0F, 255.0F));
  }
}

}  // namespace taclink
