#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace taclink {

/// Specks on a lens, in the same places of every picture: dark ones take light away, lit ones add it. Out of
/// focus, so their edges are soft.
class Dirt {
 public:
  Dirt() = default;
  Dirt(int width_px, int height_px, int specks, uint64_t seed);

  /// `gray`: 8-bit, of the size given at construction.
  void CoverLens(cv::Mat& gray) const;

 private:
  struct Pixel {
    int x, y;
    float keep, add;  // gray = keep * gray + add
  };
  std::vector<Pixel> pixels_;
};

}  // namespace taclink
