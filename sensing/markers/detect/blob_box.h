#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "sensing/core/geometry.h"

namespace taclink {

/// The pixels of a blob and of its bounding box with one more all round, laid out for vector code: rows of a
/// multiple of 16, no loop with a rest. Positions count from the box's middle. Allocates only for a larger
/// box than those before.
class BlobBox {
 public:
  /// The bounding box: [x0, x1) x [y0, y1). Begins without pixels of the blob.
  void Open(const cv::Mat& gray, int x0, int y0, int x1, int y1);
  /// Pixels [begin, end) of row y are the blob's. By rising y, then x.
  void AddRun(int y, int begin, int end);
  /// All runs are there.
  void Close();

  struct Sum {
    int levels = 0, pixels = 0;  // gray levels, number
  };
  /// Of the blob's pixels of at least that gray level (> 0).
  Sum AtLeast(int level) const;

  /// The pixels that touch the blob's sides; `dark`: how many are darker than a level.
  struct Outline {
    int levels = 0, pixels = 0, dark = 0;
  };
  Outline Around(int level) const;

  /// Sums over the blob's pixels above a level: of 1, of places, and of gray levels v.
  struct Inside {
    double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0, v = 0, vx = 0, vy = 0;
  };
  Inside Above(int level) const;

  /// How gray levels become weights: (level - base) (1 - shade . place), from 0 at `low` to 1 at `high`.
  struct Ramp {
    double base = 0, low = 0, high = 1;  // low and high above base
    Vec2 shade = Vec2::Zero();           // per px
  };
  /// Sums of weights w; `edge`: of the pixels between 0 and 1, each counted once.
  struct Coverage {
    double w = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
    double edge = 0, edge_xx = 0, edge_xy = 0, edge_yy = 0;
  };
  Coverage Cover(const Ramp& ramp) const;

  /// The pixels that touch the blob's sides are its own from now on.
  void Widen();

  Vec2 middle() const { return {x0_ + middle_x_, y0_ + middle_y_}; }

 private:
  size_t size() const { return static_cast<size_t>(rows_) * static_cast<size_t>(stride_); }
  void CopyRow(const cv::Mat& gray, int row);

  int x0_ = 0, y0_ = 0, rows_ = 0, stride_ = 0;  // of the box with its rim
  double middle_x_ = 0, middle_y_ = 0;
  int outside_ = 0;                                  // sides of the blob's pixels that are the picture's edge
  int left_ = 0, right_ = 0, top_ = 0, bottom_ = 0;  // the picture in the box: columns and rows
  std::vector<uint8_t> gray_;                        // by row; kOutside beyond the picture
  std::vector<uint8_t> mask_;                        // 255: the blob's; a row more before and after
  std::vector<uint8_t> own_;                         // gray levels of the blob's pixels, others 0
};

}  // namespace taclink
