#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/markers/track/window_measure.h"

namespace taclink {

/// How a marker looked when it was last measured, to find out how far it has moved since: one step of a
/// least-squares fit of shift, gain and offset [lucas1981],
///   I(x) = (1 + a) R(x) + b - (1 + a) d . grad R(x),
/// whose normal matrix is constant: the gradient is R's [baker2004]. Good for shifts up to about 0.6 px
/// beside a whole number of pixels. Memory is taken at construction; larger windows are thinned out by rows.
class ReferencePatch {
 public:
  explicit ReferencePatch(int capacity_px);

  /// Takes the blob and a pixel around it. False: not enough of it to tell a shift; the patch is empty then.
  bool Take(const cv::Mat& gray, const WindowBlob& blob, const Vec2& center_px);
  void Clear() { count_ = 0; }
  bool empty() const { return count_ == 0; }

  struct Shift {
    Vec2 center_px = Vec2::Zero();
    double gain = 1;
    double residual2 = 0;     ///< mean square of what the fit leaves, gray levels
    double off_whole_px = 0;  ///< shift beside whole pixels, the larger axis
    bool valid = false;       ///< false: out of the picture, or no fit
  };
  /// With the patch laid where its centre is next to `expected_px`.
  Shift Register(const cv::Mat& gray, const Vec2& expected_px) const;

  /// Has the memory that Register reads brought nearer, while another is worked on.
  void Prefetch() const {
    constexpr int kLine = 64;  // bytes
    for (int at = 0; at < 3 * count_; at += kLine) __builtin_prefetch(pixels_.data() + at);
  }

  const Vec2& center_px() const { return center_px_; }
  int pixels() const { return used_; }  ///< that Register reads

 private:
  static constexpr int kBlock = 8;  // pixels that are handled together

  void TakeRow(const cv::Mat& gray, const WindowBlob& blob, int row);
  bool Solve();
  uint8_t* reference() { return pixels_.data(); }
  const uint8_t* reference() const { return pixels_.data(); }
  int8_t* gx() { return reinterpret_cast<int8_t*>(pixels_.data() + count_); }
  const int8_t* gx() const { return reinterpret_cast<const int8_t*>(pixels_.data() + count_); }
  int8_t* gy() { return gx() + count_; }
  const int8_t* gy() const { return gx() + count_; }

  int capacity_;
  // By row, blocks side by side: the reference, 0 outside the mask; half its gradient along x and along y.
  std::vector<uint8_t> pixels_;
  int count_ = 0, used_ = 0;
  int x0_ = 0, y0_ = 0, blocks_ = 0, rows_ = 0, step_ = 1;
  Vec2 center_px_ = Vec2::Zero();
  Eigen::Matrix4f inverse_ = Eigen::Matrix4f::Zero();  // of the normal matrix; unknowns a, b, shift
};

}  // namespace taclink
