#include "sensing/markers/window_measure.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

namespace taclink {
namespace {

constexpr int kMargin = 3;                  // px around the spot, for its rim and the dark beside it
constexpr int kSmallArea = 60;              // px^2, of the whole spot; as in MarkerDetector
constexpr int kLeastContrast = 6;           // gray levels
constexpr double kLevels[] = {0.42, 0.62};  // of the contrast; the second parts spots that touch
constexpr int kSaturated = 250;
constexpr double kBloom = 1.5;      // a spot that saturates looks larger
constexpr double kAreaSlack = 1.5;  // px^2
constexpr double kMaxAreaRatio = 1.9, kMaxContrastRatio = 2.6;

// Whichever bits of `mask` hang together with a bit of `seed` in the row.
uint64_t FillRow(uint64_t seed, uint64_t mask) {
  uint64_t up = seed & mask, down = up, m = mask, n = mask;
  for (int step = 1; step < 64; step *= 2) {
    up |= m & (up << step);
    m &= m << step;
    down |= n & (down >> step);
    n &= n >> step;
  }
  return up | down;
}

uint64_t Bits(int begin, int end) {
  if (end <= begin) return 0;
  return (end - begin >= 64 ? ~uint64_t{0} : (uint64_t{1} << (end - begin)) - 1) << begin;
}

uint64_t Wider(uint64_t row) {
  return row | row << 1 | row >> 1;
}

// Takes a row into the least and the greatest by column. `width`: a multiple of 8.
template <bool kBright>
void Extend(const uint8_t* __restrict p, int width, uint8_t* __restrict low, uint8_t* __restrict high) {
  for (int x = 0; x < width; x += 8) {
    for (int i = x; i < x + 8; ++i) {
      low[i] = std::min(low[i], p[i]);
      if constexpr (kBright) high[i] = std::max(high[i], p[i]);
    }
  }
}

// A row of pixels brighter than a level, one bit each. Reads whole blocks of 8: the caller sees to it that
// they are in the picture.
uint64_t Brighter(const uint8_t* p, int width, int level) {
  uint64_t bits = 0;
  for (int x = 0; x < width; x += 8) {
    std::array<uint8_t, 8> flags;
    for (size_t i = 0; i < 8; ++i) flags[i] = p[static_cast<size_t>(x) + i] > level ? 1 : 0;
    uint64_t eight = 0;
    std::memcpy(&eight, flags.data(), 8);
    bits |= (eight * 0x0102040810204080ULL >> 56) << x;
  }
  return bits;
}

}  // namespace

bool WindowMeasure::Find(const cv::Mat& gray, const WindowTarget& target, WindowBlob& blob) {
  pixels_ = 0;
  if (!PlaceWindow(gray, target, blob)) return false;
  FindLevels(gray, target, blob);
  pixels_ = blob.window_width * blob.window_height;
  const int contrast = bright_ - dark_;
  if (contrast < kLeastContrast) return false;
  for (const double level : kLevels) {
    Threshold(gray, blob, dark_ + static_cast<int>(level * contrast));
    if (!ChoosePart(target, blob)) continue;
    FindRim(blob);
    const double bloom = bright_ >= kSaturated ? kBloom : 1;
    const double ratio = kMaxContrastRatio * target.looseness;
    return Measure(gray, blob) && blob.spread_px2 < bloom * target.max_spread_px2 &&
           blob.area_px2 < bloom * target.max_growth * target.area_px2 + kAreaSlack &&
           blob.contrast < ratio * target.contrast && blob.contrast * ratio > target.contrast;
  }
  return false;
}

bool WindowMeasure::PlaceWindow(const cv::Mat& gray, const WindowTarget& target, WindowBlob& blob) const {
  const auto place = [&](double expected, double size, int picture, int& begin, int& width) {
    const double half = 0.5 * size + target.reach_px + kMargin;
    if (!(expected > -half && expected < picture + half) || picture < 16) return false;
    const int most = std::min(WindowBlob::kMaxSide, picture);
    const int whole = static_cast<int>(std::ceil(2 * half));
    width = std::min((whole + 7) / 8 * 8, most / 8 * 8);
    begin = static_cast<int>(std::lround(expected)) - width / 2;
    begin = std::clamp(begin, 0, picture - width);
    return true;
  };
  if (!place(target.expected_px.x(), target.width_px, gray.cols, blob.window_x, blob.window_width)) {
    return false;
  }
  return place(target.expected_px.y(), target.height_px, gray.rows, blob.window_y, blob.window_height);
}

// The darkest is what surrounds the spot; the brightest within reach is the spot.
void WindowMeasure::FindLevels(const cv::Mat& gray, const WindowTarget& target, const WindowBlob& blob) {
  alignas(16) std::array<uint8_t, WindowBlob::kMaxSide> low, high;
  low.fill(255);
  high.fill(0);
  const int width = blob.window_width, height = blob.window_height;
  const auto near = [](double expected, double reach, int size, int& begin, int& end) {
    begin = std::clamp(static_cast<int>(std::ceil(expected - reach)), 0, size);
    end = std::clamp(static_cast<int>(std::floor(expected + reach)) + 1, 0, size);
  };
  int x0, x1, y0, y1;
  near(target.expected_px.x() - blob.window_x, target.reach_px + 0.3 * target.width_px, width, x0, x1);
  near(target.expected_px.y() - blob.window_y, target.reach_px + 0.3 * target.height_px, height, y0, y1);
  for (int y = 0; y < height; ++y) {
    const uint8_t* p = gray.ptr(blob.window_y + y) + blob.window_x;
    y >= y0&& y < y1 ? Extend<true>(p, width, low.data(), high.data())
                     : Extend<false>(p, width, low.data(), high.data());
  }
  uint8_t dark = 255, bright = 0;
  for (int x = 0; x < width; ++x) dark = std::min(dark, low[static_cast<size_t>(x)]);
  for (int x = x0; x < x1; ++x) bright = std::max(bright, high[static_cast<size_t>(x)]);
  dark_ = dark, bright_ = bright;
}

void WindowMeasure::Threshold(const cv::Mat& gray, const WindowBlob& blob, int level) {
  for (int y = 0; y < blob.window_height; ++y) {
    mask_[static_cast<size_t>(y)] =
        Brighter(gray.ptr(blob.window_y + y) + blob.window_x, blob.window_width, level);
  }
}

// Of the components that reach into the search area, the one nearest to where the spot is expected.
bool WindowMeasure::ChoosePart(const WindowTarget& target, const WindowBlob& blob) {
  const double ex = target.expected_px.x() - blob.window_x, ey = target.expected_px.y() - blob.window_y;
  const auto limit = [](double v, int size) { return std::clamp(static_cast<int>(v), 0, size); };
  const int y0 = limit(std::floor(ey - target.reach_px), blob.window_height);
  const int y1 = limit(std::ceil(ey + target.reach_px) + 1, blob.window_height);
  const uint64_t area = Bits(limit(std::floor(ex - target.reach_px), blob.window_width),
                             limit(std::ceil(ex + target.reach_px) + 1, blob.window_width));
  left_ = mask_;
  const double ratio = kMaxAreaRatio * target.looseness;
  double nearest = target.reach_px * target.reach_px;
  bool found = false;
  for (int y = y0; y < y1; ++y) {
    while (const uint64_t here = left_[static_cast<size_t>(y)] & area) {
      Flood(blob, y, here & (~here + 1), part_);
      for (int k = part_.y_begin; k < part_.y_end; ++k) {
        left_[static_cast<size_t>(k)] &= ~part_.rows[static_cast<size_t>(k)];
      }
      const double dx = 0.5 * (part_.x_begin + part_.x_end - 1) - ex;
      const double dy = 0.5 * (part_.y_begin + part_.y_end - 1) - ey;
      const bool fits = part_.area < ratio * target.area_px2 && part_.area * ratio > target.area_px2 &&
                        part_.area >= 4 &&
                        2.5 * part_.area > (part_.x_end - part_.x_begin) * (part_.y_end - part_.y_begin);
      if (!fits || dx * dx + dy * dy > nearest) continue;
      nearest = dx * dx + dy * dy;
      best_ = part_;
      found = true;
    }
  }
  return found;
}

void WindowMeasure::Flood(const WindowBlob& blob, int y, uint64_t seed, Part& part) const {
  Rows& rows = part.rows;
  int begin = y, end = y + 1;
  rows[static_cast<size_t>(y)] = FillRow(seed, mask_[static_cast<size_t>(y)]);
  const auto spread = [&](int from, int to) {  // one row into the next; true: that row grew
    const auto t = static_cast<size_t>(to);
    const bool is_new = to < begin || to >= end;
    const uint64_t old = is_new ? 0 : rows[t];
    const uint64_t seeds = (rows[static_cast<size_t>(from)] & mask_[t]) | old;
    if (seeds == old) return false;
    rows[t] = FillRow(seeds, mask_[t]);
    begin = std::min(begin, to), end = std::max(end, to + 1);
    return true;
  };
  // The first sweep reaches all of a convex spot; others fill what bends back.
  for (bool grown = true; grown;) {
    grown = false;
    for (int k = begin; k + 1 < blob.window_height && k < end; ++k) grown |= spread(k, k + 1);
    for (int k = end - 1; k > 0 && k >= begin; --k) grown |= spread(k, k - 1);
  }
  uint64_t all = 0;
  part.area = 0;
  for (int k = begin; k < end; ++k) {
    all |= rows[static_cast<size_t>(k)];
    part.area += std::popcount(rows[static_cast<size_t>(k)]);
  }
  part.y_begin = begin, part.y_end = end;
  part.x_begin = std::countr_zero(all), part.x_end = 64 - std::countl_zero(all);
}

// A pixel all round, but for those that touch another spot.
void WindowMeasure::FindRim(WindowBlob& blob) const {
  const auto own = [&](int y) {
    return y >= best_.y_begin && y < best_.y_end ? best_.rows[static_cast<size_t>(y)] : 0;
  };
  const auto other = [&](int y) {
    return y >= 0 && y < blob.window_height ? mask_[static_cast<size_t>(y)] & ~own(y) : 0;
  };
  const uint64_t inside = Bits(0, blob.window_width);
  for (int y = 0; y < blob.window_height; ++y) {
    uint64_t& rim = blob.rim[static_cast<size_t>(y)];
    rim = 0;
    if (y < best_.y_begin - 1 || y > best_.y_end) continue;
    const uint64_t grown = Wider(own(y)) | Wider(own(y - 1)) | Wider(own(y + 1));
    const uint64_t foreign = Wider(other(y)) | other(y - 1) | other(y + 1);
    rim = grown & (~foreign | own(y)) & inside;
  }
  blob.x_begin = blob.window_x + best_.x_begin, blob.x_end = blob.window_x + best_.x_end;
  blob.y_begin = blob.window_y + best_.y_begin, blob.y_end = blob.window_y + best_.y_end;
}

// Soft coverage, as in MarkerDetector: a pixel's weight rises from 0 to 1 between two levels of the edge.
bool WindowMeasure::Measure(const cv::Mat& gray, WindowBlob& blob) const {
  const auto each_run = [&](auto&& add) {
    for (int y = std::max(best_.y_begin - 1, 0); y < std::min(best_.y_end + 1, blob.window_height); ++y) {
      const uint8_t* row = gray.ptr(blob.window_y + y) + blob.window_x;
      for (uint64_t rest = blob.rim[static_cast<size_t>(y)]; rest != 0;) {
        const int begin = std::countr_zero(rest);
        const int length = std::countr_one(rest >> begin);
        add(row, y, begin, begin + length);
        rest &= ~Bits(begin, begin + length);
      }
    }
  };
  const int half = (dark_ + bright_) / 2;
  int sum = 0, count = 0;
  each_run([&](const uint8_t* row, int, int begin, int end) {
    for (int x = begin; x < end; ++x) {
      const int in = row[x] >= half ? 1 : 0;
      sum += in * row[x], count += in;
    }
  });
  if (count == 0) return false;
  const double mean = static_cast<double>(sum) / count, contrast = mean - dark_;
  if (contrast < kLeastContrast) return false;
  const bool small = count < kSmallArea / 2;
  const double low = dark_ + (small ? 0.12 : 0.25) * contrast;
  const double high = small ? mean + 0.1 * contrast : 0.5 * (low + mean);
  const int low16 = static_cast<int>(16 * low), slope = static_cast<int>(4096 / (high - low));
  const int x_middle = (best_.x_begin + best_.x_end) / 2, y_middle = (best_.y_begin + best_.y_end) / 2;
  int w_sum = 0, wx = 0, wy = 0, wxx = 0, wxy = 0, wyy = 0;
  each_run([&](const uint8_t* row, int y, int begin, int end) {
    const int dy = y - y_middle;
    int s0 = 0, s1 = 0, s2 = 0;
    for (int x = begin; x < end; ++x) {
      const int w = std::clamp(((16 * row[x] - low16) * slope) >> 8, 0, 256);
      const int dx = x - x_middle;
      s0 += w, s1 += w * dx, s2 += w * dx * dx;
    }
    w_sum += s0, wx += s1, wy += s0 * dy;
    wxx += s2, wxy += s1 * dy, wyy += s0 * dy * dy;
  });
  if (w_sum < 256) return false;
  const auto mean_of = [&](int total) { return static_cast<double>(total) / w_sum; };
  const double mx = mean_of(wx), my = mean_of(wy);
  const double xx = mean_of(wxx) - mx * mx, yy = mean_of(wyy) - my * my, xy = mean_of(wxy) - mx * my;
  blob.area_px2 = w_sum / 256.0;
  blob.contrast = contrast;
  blob.center_px = Vec2(blob.window_x + x_middle + mx, blob.window_y + y_middle + my);
  blob.spread_px2 = 0.5 * (xx + yy) + std::hypot(0.5 * (xx - yy), xy);
  blob.clipped = blob.x_begin <= 0 || blob.y_begin <= 0 || blob.x_end >= gray.cols || blob.y_end >= gray.rows;
  return true;
}

}  // namespace taclink
