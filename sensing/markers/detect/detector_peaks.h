#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "sensing/core/markers.h"

namespace taclink {

/// A marker a few pixels across: a bell over a sloping background,
///   base + slope . d + height exp(-d' precision d / 2), d = pixel - centre.
struct Bell {
  Vec2 center_px = Vec2::Zero();
  Vec2 start_px = Vec2::Zero();   ///< the local maximum it began at
  Mat2 precision = Mat2::Zero();  ///< px^-2
  double height = 0, base = 0;    ///< gray levels
  Vec2 slope = Vec2::Zero();      ///< gray levels per px
  double misfit = 0;              ///< root mean square of what the model leaves, gray levels
  bool good = false;
  bool known = false;    ///< not fitted
  bool settled = false;  ///< the last step was small
};

/// Finds local maxima that fall off on all sides within a few pixels, and fits bells to all of them at once:
/// markers that run into each other come apart as long as each has a summit of its own. Allocates only when a
/// picture is larger or fuller than those before. One thread.
class BellFinder {
 public:
  /// Starts a picture. `noise` and `contrast` (the least height): gray levels.
  void Begin(const cv::Mat& gray, double noise, double contrast);

  /// The box whose maxima are looked for next: [x0, x1) x [y0, y1).
  void OpenBox(int x0, int y0, int x1, int y1);
  /// Takes the maxima among a row's pixels [begin, end), inside the box.
  void AddSummits(int y, int begin, int end);
  /// Takes those away that nothing deeper than noise parts from a higher one; `base`: the gray level around.
  void MergeSummits(double base);
  /// How many of them a dip parts that is deeper than this part of their height: shade inside a marker makes
  /// shallow ones.
  int CountSummits(double base, double dip) const;
  /// Makes bells of them, of those that fall off on all sides.
  void TakeSummits();
  /// A marker whose place is known, but whose light reaches into the others' windows.
  void AddKnown(const Vec2& center_px, const Mat2& spread_px2, double height);

  /// Fits all of them.
  void Fit();

  /// Leaves out a bell.
  template <typename Test>
  void DropIf(Test test) {
    bells_.erase(std::remove_if(bells_.begin(), bells_.end(), test), bells_.end());
  }

  const std::vector<Bell>& bells() const { return bells_; }

 private:
  static constexpr int kMaxPixels = 256;
  using Pixels = Eigen::Array<float, Eigen::Dynamic, 1, Eigen::ColMajor, kMaxPixels, 1>;
  struct Summit {
    int x, y, level;  // smoothed
  };
  struct Place {
    float x, y;
  };
  struct Neighbour {
    int bell, other;
  };
  int SmoothAt(int x, int y) const {  // from the box, where it is
    const int i = x - x0_ + 1, k = y - y0_ + 1;
    const bool inside = i >= 0 && i < box_width_ && k >= 0 && k < box_height_;
    return inside ? smooth_[static_cast<size_t>(k * box_width_ + i)] : Smooth(x, y);
  }
  int Smooth(int x, int y) const;  // 3 x 3 binomial mean, times 16
  bool Surrounded(int x, int y, Bell& bell) const;
  bool Stands(const Summit& s, size_t higher, double base, double dip) const;
  int LowestBetween(int x0, int y0, int x1, int y1) const;
  void FindNeighbours();
  bool LookAt(size_t index, double radius_squared);
  void Shape(const Bell& bell, const Vec2& from, Pixels& out) const;
  void TakeAway(const Bell& bell, const Vec2& from);
  void Improve(size_t index);

  cv::Mat gray_;
  double noise_ = 1, contrast_ = 10;
  int x0_ = 0, y0_ = 0, box_width_ = 0, box_height_ = 0;
  std::vector<uint16_t> smooth_, column_;  // of the box and a pixel around it; a row's vertical sums
  std::vector<Summit> summits_;
  std::vector<Bell> bells_;
  std::vector<Place> places_;          // of the bells
  std::vector<Neighbour> neighbours_;  // by bell
  std::vector<int> first_neighbour_;
  Pixels dx_, dy_, value_, shape_;  // of the pixels that a fit looks at, from its bell's centre
};

}  // namespace taclink
