#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>

#include "sensing/core/geometry.h"

namespace taclink {

/// What is looked for in a window.
struct WindowTarget {
  Vec2 expected_px = Vec2::Zero();
  double reach_px = 2;  ///< it is at most this far from there
  double width_px = 0, height_px = 0;
  double area_px2 = 0;
  double contrast = 0;          ///< gray levels
  double max_spread_px2 = 1e9;  ///< variance of the spot along its longer axis; more is two markers
  double max_growth = 4;        ///< factor of the area, but for a pixel or two
  double looseness = 1;  ///< factor that area and contrast may be off by, beside the usual one of about 2
};

/// A connected bright spot in a window of at most 64 x 64 pixels.
struct WindowBlob {
  static constexpr int kMaxSide = 64;

  Vec2 center_px = Vec2::Zero();
  double area_px2 = 0;
  double contrast = 0;
  double spread_px2 = 0;  ///< variance along the longer axis
  bool clipped = false;   ///< touches the picture's edge
  // Upright bounding box, [begin, end).
  int x_begin = 0, x_end = 0, y_begin = 0, y_end = 0;
  // The window, and by its rows: the blob with its rim.
  int window_x = 0, window_y = 0, window_width = 0, window_height = 0;
  std::array<uint64_t, kMaxSide> rim;
};

/// Finds and measures single spots in small windows, the way MarkerDetector measures those of a whole
/// picture. Allocates nothing.
class WindowMeasure {
 public:
  /// False: there is no such spot. What is found differs from the target in area and contrast by less than a
  /// factor of about 2, and is nearer to the expected place than any other.
  bool Find(const cv::Mat& gray, const WindowTarget& target, WindowBlob& blob);

  /// Pixels that the last call read.
  int pixels() const { return pixels_; }

 private:
  static constexpr int kBlock = 8;  // pixels that are handled together
  using Rows = std::array<uint64_t, WindowBlob::kMaxSide>;
  struct Part {  // a connected component
    Rows rows;
    int y_begin, y_end, x_begin, x_end, area;
  };

  bool PlaceWindow(const cv::Mat& gray, const WindowTarget& target, WindowBlob& blob) const;
  void FindLevels(const cv::Mat& gray, const WindowTarget& target, const WindowBlob& blob);
  void Threshold(const cv::Mat& gray, const WindowBlob& blob, int level);
  bool ChoosePart(const WindowTarget& target, const WindowBlob& blob);
  void Flood(const WindowBlob& blob, int y, uint64_t seed, Part& part) const;
  void FindRim(WindowBlob& blob) const;
  void Gather(const cv::Mat& gray, const WindowBlob& blob);
  bool Measure(const cv::Mat& gray, WindowBlob& blob);

  int pixels_ = 0;
  int dark_ = 0, bright_ = 0;  // gray levels of the window
  Rows mask_, left_;
  Part part_, best_;
  // The spot's pixels from the window's row and column on; the columns of 8 pixels after one another.
  std::array<uint8_t, WindowBlob::kMaxSide * WindowBlob::kMaxSide + kBlock> spot_;
  int first_row_ = 0, rows_ = 0, first_column_ = 0, blocks_ = 0;
};

}  // namespace taclink
