#include "sensing/markers/detect/detector_peaks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "sensing/markers/detect/lanes.h"

namespace taclink {
namespace {

constexpr int kReach = 7;               // px, within which a maximum falls off
constexpr double kDip = 0.06;           // of the height: deeper ones part two summits
constexpr double kWiggle = 2.5;         // sigmas of the noise that no dip is
constexpr double kSmoothNoise = 0.375;  // of the binomial mean, over a pixel's
constexpr int kScale = 16;              // of smoothed levels
constexpr int kTogether = 8;            // pixels

struct Step {
  int dx, dy;
};
constexpr std::array<Step, 8> kAround = {
    {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}}};

}  // namespace

void BellFinder::Begin(const cv::Mat& gray, double noise, double contrast) {
  gray_ = gray;
  noise_ = noise, contrast_ = contrast;
  bells_.clear();
}

int BellFinder::Smooth(int x, int y) const {
  const int left = std::max(x - 1, 0), right = std::min(x + 1, gray_.cols - 1);
  int sum = 0;
  for (int k = -1; k <= 1; ++k) {
    const uint8_t* row = gray_.ptr(std::clamp(y + k, 0, gray_.rows - 1));
    sum += (row[left] + 2 * row[x] + row[right]) * (2 - std::abs(k));
  }
  return sum;
}

void BellFinder::OpenBox(int x0, int y0, int x1, int y1) {
  summits_.clear();
  x0_ = x0, y0_ = y0, box_width_ = x1 - x0 + 2;
  const int height = box_height_ = y1 - y0 + 2;
  // A little more than the box: what is worked on together reaches past it.
  smooth_.resize(std::max(smooth_.size(), static_cast<size_t>(box_width_ * height) + kTogether));
  column_.resize(static_cast<size_t>(gray_.cols) + 4 + 2 * kTogether);
  for (int k = 0; k < height; ++k) {
    const int y = std::clamp(y0 - 1 + k, 0, gray_.rows - 1);
    const uint8_t *above = gray_.ptr(std::max(y - 1, 0)), *here = gray_.ptr(y),
                  *below = gray_.ptr(std::min(y + 1, gray_.rows - 1));
    // column_[i]: at x0 - 2 + i, the picture's edge pixels repeated.
    const int first = std::max(x0 - 2, 0), last = std::min(x1 + 2, gray_.cols);
    uint16_t* column = column_.data() + (first - (x0 - 2));
    int x = first;
    for (; x < last && x + kTogether <= gray_.cols; x += kTogether) {
      const Shorts8 sums = EightShorts(LoadEight(above + x)) + 2 * EightShorts(LoadEight(here + x)) +
                           EightShorts(LoadEight(below + x));
      std::memcpy(column + (x - first), &sums, sizeof sums);
    }
    for (; x < last; ++x) column[x - first] = static_cast<uint16_t>(above[x] + 2 * here[x] + below[x]);
    for (int i = 0; i < first - (x0 - 2); ++i) column_[static_cast<size_t>(i)] = column[0];
    for (x = last; x < x1 + 2; ++x) column[x - first] = column[last - 1 - first];
    uint16_t* out = smooth_.data() + k * box_width_;
    const uint16_t* in = column_.data();
    for (int i = 0; i < box_width_; i += kTogether) {
      const Shorts8 sums = LoadShorts(in + i) + 2 * LoadShorts(in + i + 1) + LoadShorts(in + i + 2);
      std::memcpy(out + i, &sums, sizeof sums);
    }
  }
}

void BellFinder::AddSummits(int y, int begin, int end) {
  const uint16_t* row = smooth_.data() + (y - y0_ + 1) * box_width_ - x0_ + 1;
  const auto load = [](const uint16_t* p) { return reinterpret_cast<SignedShorts8>(LoadShorts(p)); };
  for (int x = begin; x < end; x += kTogether) {
    const uint16_t *at = row + x, *up = at - box_width_, *down = at + box_width_;
    const SignedShorts8 v = load(at);
    const auto most = (load(at - 1) < v) & (load(up - 1) < v) & (load(up) < v) & (load(up + 1) < v) &
                      (load(at + 1) <= v) & (load(down - 1) <= v) & (load(down) <= v) & (load(down + 1) <= v);
    if (!Any(reinterpret_cast<Longs2>(most))) continue;
    for (int i = 0; i < std::min(kTogether, end - x); ++i) {
      if (most[i] != 0) summits_.push_back({x + i, y, at[i]});
    }
  }
}

void BellFinder::MergeSummits(double base) {
  std::sort(summits_.begin(), summits_.end(),
            [](const Summit& a, const Summit& b) { return a.level > b.level; });
  size_t kept = 0;
  for (const Summit& s : summits_) {
    if (Stands(s, kept, base, kDip)) summits_[kept++] = s;
  }
  summits_.resize(kept);
}

int BellFinder::CountSummits(double base, double dip) const {
  int count = 0;
  for (size_t i = 0; i < summits_.size(); ++i) count += Stands(summits_[i], i, base, dip) ? 1 : 0;
  return count;
}

// Parted from the first `higher` ones.
bool BellFinder::Stands(const Summit& s, size_t higher, double base, double dip) const {
  const double wiggle = kWiggle * kSmoothNoise * kScale * noise_;
  const double least = std::max(wiggle, dip * (s.level - kScale * base));
  for (size_t k = higher; k-- > 0;) {
    const Summit& other = summits_[k];
    if (std::abs(other.x - s.x) > kReach || std::abs(other.y - s.y) > kReach) continue;
    if (s.level - LowestBetween(s.x, s.y, other.x, other.y) <= least) return false;
  }
  return true;
}

int BellFinder::LowestBetween(int x0, int y0, int x1, int y1) const {
  const int steps = std::max(std::abs(x1 - x0), std::abs(y1 - y0));
  int least = 255 * kScale;
  for (int k = 1; k < steps; ++k) {
    const int x = x0 + (2 * (x1 - x0) * k + steps) / (2 * steps),
              y = y0 + (2 * (y1 - y0) * k + steps) / (2 * steps);
    least = std::min(least, SmoothAt(x, y));
  }
  return least;
}

void BellFinder::TakeSummits() {
  for (const Summit& s : summits_) {
    Bell bell;
    if (Surrounded(s.x, s.y, bell)) bells_.push_back(bell);
  }
}

void BellFinder::AddKnown(const Vec2& center_px, const Mat2& spread_px2, double height) {
  Bell bell;
  bell.center_px = bell.start_px = center_px;
  bell.precision = spread_px2.inverse();
  bell.height = height;
  bell.known = bell.good = true;
  bells_.push_back(bell);
}

// Falls off on all sides, far enough on most of them; from where it has lost half, the bell's first shape.
bool BellFinder::Surrounded(int x, int y, Bell& bell) const {
  const double top = SmoothAt(x, y);
  const double wiggle = 2.5 * kSmoothNoise * kScale * noise_;
  std::array<double, 8> drop{}, half{};
  std::array<std::array<int, kReach + 1>, 8> path{};
  std::array<int, 8> lowest{};
  for (size_t d = 0; d < 8; ++d) {
    const int reach = d % 2 == 0 ? kReach : (kReach * 5 + 3) / 7;
    path[d][0] = static_cast<int>(top);
    int least = static_cast<int>(top);
    for (int k = 1; k <= reach; ++k) {
      const int xx = x + k * kAround[d].dx, yy = y + k * kAround[d].dy;
      if (xx < 0 || yy < 0 || xx >= gray_.cols || yy >= gray_.rows) break;
      const int v = path[d][static_cast<size_t>(k)] = SmoothAt(xx, yy);
      if (v < least) least = v, lowest[d] = k;
      if (v > least + wiggle) break;
    }
    drop[d] = top - least;
  }
  std::array<double, 8> sorted = drop;
  std::sort(sorted.begin(), sorted.end());
  const double height = 0.25 * (sorted[4] + sorted[5] + sorted[6] + sorted[7]);
  if (height < kScale * contrast_ || sorted[0] < std::max(wiggle, 0.05 * height) ||
      sorted[2] < 0.3 * height) {
    return false;
  }
  const auto level = static_cast<int>(top - 0.5 * height);
  for (size_t d = 0; d < 8; ++d) {
    int k = 1;
    while (k < lowest[d] && path[d][static_cast<size_t>(k)] > level) ++k;
    const double before = path[d][static_cast<size_t>(k - 1)], here = path[d][static_cast<size_t>(k)];
    const double part = here <= level && before > here ? (before - level) / (before - here) : 1;
    half[d] = (k - 1 + part) * (d % 2 == 0 ? 1 : std::sqrt(2.0));
  }
  const auto across = [&](size_t d) {
    const double width = std::max(0.7, std::min(half[d], half[d + 4])) / 1.177;
    return 1 / (width * width);
  };
  const double xx = across(0), yy = across(2), limit = 0.8 * std::sqrt(xx * yy);
  const double xy = std::clamp(0.5 * (across(1) - across(3)), -limit, limit);
  bell.precision << xx, xy, xy, yy;
  bell.center_px = bell.start_px = Vec2(x, y);
  bell.height = height / kScale;
  bell.base = (top - height) / kScale;
  return true;
}

}  // namespace taclink
