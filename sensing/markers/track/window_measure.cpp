#include "sensing/markers/track/window_measure.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "sensing/markers/detect/lanes.h"

namespace taclink {
namespace {

constexpr int kMargin = 3;                  // px around the spot, for its rim and the dark beside it
constexpr int kSmallArea = 60;              // px^2, of the whole spot; as in MarkerDetector
constexpr int kLeastContrast = 6;           // gray levels
constexpr double kLeastArea = 4;            // px^2 above the level; of the smallest spots
constexpr double kLeastPart = 0.6;          // of what they had
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

constexpr int kWide = sizeof(Bytes16);
// By column of a block, over its rows: the sums of the weights w, of w y and of w y^2.
struct ColumnSums {
  std::array<float, 8> w, wy, wyy;
};

// y counts from y0 along the block's rows.
void SumColumns(const uint8_t* block, int rows, float y0, float low, float slope, ColumnSums& sums) {
  std::array<Floats4, 2> w_sum{}, wy_sum{}, wyy_sum{};
  float y = y0;
  for (int row = 0; row < rows; ++row, block += 8, y += 1) {
    const Floats8 pixels(block);
    const std::array<Floats4, 2> w = {Clamped((pixels.low - low) * slope),
                                      Clamped((pixels.high - low) * slope)};
    for (size_t i = 0; i < 2; ++i) {
      w_sum[i] += w[i], wy_sum[i] += w[i] * y, wyy_sum[i] += w[i] * (y * y);
    }
  }
  std::memcpy(sums.w.data(), w_sum.data(), sizeof sums.w);
  std::memcpy(sums.wy.data(), wy_sum.data(), sizeof sums.wy);
  std::memcpy(sums.wyy.data(), wyy_sum.data(), sizeof sums.wyy);
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
  const auto place = [&](double expected, double size, int picture, int step, int& begin, int& width) {
    const double half = 0.5 * size + target.reach_px + kMargin;
    if (!(expected > -half && expected < picture + half) || picture < 16) return false;
    const int most = std::min(WindowBlob::kMaxSide, picture);
    const int whole = static_cast<int>(std::ceil(2 * half));
    width = std::min((whole + step - 1) / step * step, most / step * step);
    begin = static_cast<int>(std::lround(expected)) - width / 2;
    begin = std::clamp(begin, 0, picture - width);
    return true;
  };
  // Whole blocks of pixels, and at least what is compared together.
  if (!place(target.expected_px.x(), target.width_px, gray.cols, kBlock, blob.window_x, blob.window_width) ||
      blob.window_width < kWide) {
    return false;
  }
  return place(target.expected_px.y(), target.height_px, gray.rows, kBlock, blob.window_y,
               blob.window_height);
}

// The darkest is what surrounds the spot; the brightest within reach is the spot.
void WindowMeasure::FindLevels(const cv::Mat& gray, const WindowTarget& target, const WindowBlob& blob) {
  const int width = blob.window_width, height = blob.window_height;
  const auto near = [](double expected, double reach, int size, int& begin, int& end) {
    begin = std::clamp(static_cast<int>(std::ceil(expected - reach)), 0, size);
    end = std::clamp(static_cast<int>(std::floor(expected + reach)) + 1, 0, size);
  };
  int x0, x1, y0, y1;
  near(target.expected_px.x() - blob.window_x, target.reach_px + 0.3 * target.width_px, width, x0, x1);
  near(target.expected_px.y() - blob.window_y, target.reach_px + 0.3 * target.height_px, height, y0, y1);
  const auto step = static_cast<std::ptrdiff_t>(gray.step[0]);
  Bytes16 low = ~Bytes16{};
  uint8_t bright = 0;
  for (int x = 0; x < width; x += kWide) {
    const int at = std::min(x, width - kWide);
    const uint8_t* p = gray.ptr(blob.window_y) + blob.window_x + at;
    Bytes16 high{};
    for (int y = 0; y < height; ++y, p += step) {
      const Bytes16 here = LoadSixteen(p);
      low = here < low ? here : low;
      if (y >= y0 && y < y1) high = here > high ? here : high;
    }
    for (int i = std::max(x0 - at, 0); i < std::min(x1 - at, kWide); ++i) bright = std::max(bright, high[i]);
  }
  uint8_t dark = 255;
  for (int i = 0; i < kWide; ++i) dark = std::min(dark, low[i]);
  dark_ = dark, bright_ = bright;
}

void WindowMeasure::Threshold(const cv::Mat& gray, const WindowBlob& blob, int level) {
  for (int y = 0; y < blob.window_height; ++y) {
    const uint8_t* p = gray.ptr(blob.window_y + y) + blob.window_x;
    uint64_t bits = 0;
    for (int x = 0; x < blob.window_width; x += kBlock) bits |= Brighter(LoadEight(p + x), level) << x;
    mask_[static_cast<size_t>(y)] = bits;
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
  const double least = std::min(kLeastArea, kLeastPart * target.area_px2);
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
                        part_.area >= least &&
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

// The pixels of the rim and what it holds, others 0, by columns of blocks.
void WindowMeasure::Gather(const cv::Mat& gray, const WindowBlob& blob) {
  first_row_ = std::max(best_.y_begin - 1, 0);
  rows_ = std::min(best_.y_end + 1, blob.window_height) - first_row_;
  first_column_ = std::max(best_.x_begin - 1, 0) / kBlock * kBlock;
  blocks_ = (std::min(best_.x_end + 1, blob.window_width) - first_column_ + kBlock - 1) / kBlock;
  for (int row = 0; row < rows_; ++row) {
    const uint8_t* p = gray.ptr(blob.window_y + first_row_ + row) + blob.window_x + first_column_;
    const uint64_t rim = blob.rim[static_cast<size_t>(first_row_ + row)] >> first_column_;
    for (int block = 0; block < blocks_; ++block) {
      const uint64_t eight = LoadEight(p + block * kBlock) & SpreadBits(rim >> (block * kBlock));
      std::memcpy(spot_.data() + (block * rows_ + row) * kBlock, &eight, sizeof eight);
    }
  }
  // An even number of blocks, so that vector code has no rest.
  std::memset(spot_.data() + blocks_ * rows_ * kBlock, 0, kBlock);
}

// Soft coverage, as in MarkerDetector: a pixel's weight rises from 0 to 1 between two levels of the edge.
bool WindowMeasure::Measure(const cv::Mat& gray, WindowBlob& blob) {
  Gather(gray, blob);
  const auto half = static_cast<uint8_t>((dark_ + bright_) / 2);
  int sum = 0, count = 0;
  for (size_t i = 0; i < static_cast<size_t>((blocks_ * rows_ + 1) / 2) * kWide; ++i) {
    const uint8_t bright = spot_[i] >= half ? spot_[i] : uint8_t{0};
    sum += bright, count += bright != 0 ? 1 : 0;
  }
  if (count == 0) return false;
  const double mean = static_cast<double>(sum) / count, contrast = mean - dark_;
  if (contrast < kLeastContrast) return false;
  const bool small = count < kSmallArea / 2;
  const double low = dark_ + (small ? 0.12 : 0.25) * contrast;
  const double high = small ? mean + 0.1 * contrast : 0.5 * (low + mean);
  const double x_middle = 0.5 * (best_.x_begin + best_.x_end), y_middle = 0.5 * (best_.y_begin + best_.y_end);
  double w = 0, wx = 0, wy = 0, wxx = 0, wxy = 0, wyy = 0;
  ColumnSums columns;
  for (int block = 0; block < blocks_; ++block) {
    SumColumns(spot_.data() + block * rows_ * kBlock, rows_, static_cast<float>(first_row_ - y_middle),
               static_cast<float>(low), static_cast<float>(1 / (high - low)), columns);
    double x = first_column_ + block * kBlock - x_middle;
    for (size_t i = 0; i < kBlock; ++i, ++x) {
      const double s = columns.w[i], sy = columns.wy[i];
      w += s, wx += s * x, wy += sy;
      wxx += s * x * x, wxy += sy * x, wyy += columns.wyy[i];
    }
  }
  if (w < 1) return false;
  const double mx = wx / w, my = wy / w;
  const double xx = wxx / w - mx * mx, yy = wyy / w - my * my, xy = wxy / w - mx * my;
  blob.area_px2 = w;
  blob.contrast = contrast;
  blob.center_px = Vec2(blob.window_x + x_middle + mx, blob.window_y + y_middle + my);
  blob.spread_px2 = 0.5 * (xx + yy) + std::sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy);
  blob.clipped = blob.x_begin <= 0 || blob.y_begin <= 0 || blob.x_end >= gray.cols || blob.y_end >= gray.rows;
  return true;
}

}  // namespace taclink
