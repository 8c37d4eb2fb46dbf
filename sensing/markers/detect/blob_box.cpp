#include "sensing/markers/detect/blob_box.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "sensing/markers/detect/lanes.h"

namespace taclink {
namespace {

constexpr int kLanes = sizeof(Bytes16);
constexpr uint8_t kOutside = 255;
constexpr size_t kAtOnce = 128 * kLanes;  // what lanes' sums of bytes hold

uint64_t LowBytes(int count) {
  return count >= 8 ? ~uint64_t{0} : (uint64_t{1} << (8 * count)) - 1;
}

void Store(uint8_t* p, Bytes16 sixteen) {
  std::memcpy(p, &sixteen, sizeof sixteen);
}

// Pixels that touch those of the mask, but are not of it.
Bytes16 Touching(const uint8_t* mask, std::ptrdiff_t stride) {
  return (LoadSixteen(mask - 1) | LoadSixteen(mask + 1) | LoadSixteen(mask - stride) |
          LoadSixteen(mask + stride)) &
         ~LoadSixteen(mask);
}

void AddBytes(Bytes16 bytes, Shorts8& sums) {
  const auto pairs = reinterpret_cast<Shorts8>(bytes);
  sums += (pairs & 255) + (pairs >> 8);
}

template <size_t kSums>
using Columns = std::array<std::array<float, 8>, kSums>;

// Eight columns' sums of what `add` makes of each row's pixels.
template <size_t kSums, typename Add>
void SumColumns(const uint8_t* p, int rows, std::ptrdiff_t stride, float y0, Columns<kSums>& sums, Add add) {
  std::array<std::array<Floats4, 2>, kSums> lanes{};
  Floats4 y = Floats4{} + y0;
  for (int row = 0; row < rows; ++row, p += stride, y += 1) {
    const Floats8 pixels(p);
    add(pixels.low, 0, y, lanes);
    add(pixels.high, 1, y, lanes);
  }
  for (size_t k = 0; k < kSums; ++k) std::memcpy(sums[k].data(), lanes[k].data(), sizeof sums[k]);
}

}  // namespace

void BlobBox::Open(const cv::Mat& gray, int x0, int y0, int x1, int y1) {
  x0_ = x0 - 1, y0_ = y0 - 1, rows_ = y1 - y0 + 2;
  stride_ = (x1 - x0 + 2 + kLanes - 1) / kLanes * kLanes;
  middle_x_ = 0.5 * (x1 - x0 + 1), middle_y_ = 0.5 * (y1 - y0 + 1);
  left_ = std::max(0, -x0_), right_ = std::min(stride_, gray.cols - x0_);
  top_ = std::max(0, -y0_), bottom_ = std::min(rows_, gray.rows - y0_);
  outside_ = 0;
  const size_t all = size() + static_cast<size_t>(2 * stride_ + kLanes);
  if (gray_.size() < all) {
    for (auto* bytes : {&gray_, &mask_, &own_}) bytes->resize(all);
  }
  std::memset(mask_.data(), 0, all);
  for (int row = 0; row < rows_; ++row) CopyRow(gray, row);
}

void BlobBox::CopyRow(const cv::Mat& gray, int row) {
  uint8_t* to = gray_.data() + row * stride_;
  if (row < top_ || row >= bottom_) {
    std::memset(to, kOutside, static_cast<size_t>(stride_));
    return;
  }
  if (left_ == 0 && right_ == stride_) {
    const uint8_t* from = gray.ptr(y0_ + row) + x0_;
    for (int x = 0; x < stride_; x += kLanes) Store(to + x, LoadSixteen(from + x));
    return;
  }
  std::memset(to, kOutside, static_cast<size_t>(stride_));
  std::memcpy(to + left_, gray.ptr(y0_ + row) + x0_ + left_, static_cast<size_t>(right_ - left_));
}

void BlobBox::AddRun(int y, int begin, int end) {
  const int row = y - y0_;
  uint8_t* mask = mask_.data() + (row + 1) * stride_ - x0_;
  // What is written past the end is zero, and before anything that comes later.
  for (int x = begin; x < end; x += 8) {
    const uint64_t eight = LowBytes(end - x);
    std::memcpy(mask + x, &eight, sizeof eight);
  }
  outside_ += (begin - x0_ <= left_ && left_ > 0 ? 1 : 0) + (end - x0_ >= right_ && right_ < stride_ ? 1 : 0);
  outside_ += ((row <= top_ && top_ > 0) || (row + 1 >= bottom_ && bottom_ < rows_) ? end - begin : 0);
}

void BlobBox::Close() {
  const uint8_t* mask = mask_.data() + stride_;
  for (size_t i = 0; i < size(); i += kLanes) {
    Store(own_.data() + i, LoadSixteen(gray_.data() + i) & LoadSixteen(mask + i));
  }
}

BlobBox::Sum BlobBox::AtLeast(int level) const {
  Sum sum;
  const Bytes16 least = Bytes16{} + static_cast<uint8_t>(std::clamp(level, 1, 255));
  for (size_t begin = 0; begin < size(); begin += kAtOnce) {
    Shorts8 levels{};
    Bytes16 pixels{};
    for (size_t i = begin; i < std::min(begin + kAtOnce, size()); i += kLanes) {
      const Bytes16 own = LoadSixteen(own_.data() + i);
      const auto counts = reinterpret_cast<Bytes16>(own >= least);
      AddBytes(own & counts, levels);
      pixels -= counts;
    }
    for (int k = 0; k < kLanes / 2; ++k) sum.levels += levels[k];
    for (int k = 0; k < kLanes; ++k) sum.pixels += pixels[k];
  }
  return sum;
}

BlobBox::Outline BlobBox::Around(int level) const {
  Outline outline;
  const Bytes16 limit = Bytes16{} + static_cast<uint8_t>(std::clamp(level, 0, 255));
  for (size_t begin = 0; begin < size(); begin += kAtOnce) {
    Shorts8 levels{};
    Bytes16 pixels{}, dark{};
    for (size_t i = begin; i < std::min(begin + kAtOnce, size()); i += kLanes) {
      const Bytes16 touching = Touching(mask_.data() + stride_ + i, stride_),
                    here = LoadSixteen(gray_.data() + i);
      AddBytes(touching & here, levels);
      pixels -= touching;
      dark -= touching & reinterpret_cast<Bytes16>(here < limit);
    }
    for (int k = 0; k < kLanes / 2; ++k) outline.levels += levels[k];
    for (int k = 0; k < kLanes; ++k) outline.pixels += pixels[k], outline.dark += dark[k];
  }
  outline.levels -= kOutside * outside_;
  outline.pixels -= outside_;
  return outline;
}

BlobBox::Inside BlobBox::Above(int level) const {
  Inside sums;
  const Floats4 least = Floats4{} + static_cast<float>(level);
  Columns<5> columns;
  for (int x = 0; x < stride_; x += 8) {
    SumColumns(own_.data() + x, rows_, stride_, static_cast<float>(-middle_y_), columns,
               [&](Floats4 v, size_t half, Floats4 y, auto& lanes) {
                 const Floats4 one = Floats4{} + 1, zero{};
                 const Floats4 in = v > least ? one : zero, level_in = in * v;
                 lanes[0][half] += in, lanes[1][half] += in * y, lanes[2][half] += in * (y * y);
                 lanes[3][half] += level_in, lanes[4][half] += level_in * y;
               });
    double from_middle = x - middle_x_;
    for (size_t i = 0; i < 8; ++i, ++from_middle) {
      const double n = columns[0][i], y = columns[1][i], v = columns[3][i];
      sums.n += n, sums.x += n * from_middle, sums.y += y;
      sums.xx += n * from_middle * from_middle, sums.xy += y * from_middle, sums.yy += columns[2][i];
      sums.v += v, sums.vx += v * from_middle, sums.vy += columns[4][i];
    }
  }
  return sums;
}

BlobBox::Coverage BlobBox::Cover(const Ramp& ramp) const {
  Coverage sums;
  const auto splat = [](double v) { return Floats4{} + static_cast<float>(v); };
  const Floats4 base = splat(ramp.base), low = splat(ramp.low), slope = splat(1 / (ramp.high - ramp.low));
  const Floats4 shade_x = splat(ramp.shade.x()), shade_y = splat(ramp.shade.y());
  Columns<6> columns;
  for (int x = 0; x < stride_; x += 8) {
    const auto first = static_cast<float>(x - middle_x_);
    const Floats4 steps = {0, 1, 2, 3};
    const std::array<Floats4, 2> flat = {1 - shade_x * (steps + first), 1 - shade_x * (steps + (first + 4))};
    SumColumns(own_.data() + x, rows_, stride_, static_cast<float>(-middle_y_), columns,
               [&](Floats4 v, size_t half, Floats4 y, auto& lanes) {
                 const Floats4 zero{}, one = zero + 1;
                 const Floats4 w = Clamped(((v - base) * (flat[half] - shade_y * y) - low) * slope);
                 const Floats4 below = w < one ? one : zero, edge = w > zero ? below : zero;
                 lanes[0][half] += w, lanes[1][half] += w * y, lanes[2][half] += w * (y * y);
                 lanes[3][half] += edge, lanes[4][half] += edge * y, lanes[5][half] += edge * (y * y);
               });
    double from_middle = x - middle_x_;
    for (size_t i = 0; i < 8; ++i, ++from_middle) {
      const double w = columns[0][i], wy = columns[1][i], square = from_middle * from_middle;
      sums.w += w, sums.x += w * from_middle, sums.y += wy;
      sums.xx += w * square, sums.xy += wy * from_middle, sums.yy += columns[2][i];
      sums.edge += columns[3][i];
      sums.edge_xx += columns[3][i] * square, sums.edge_xy += columns[4][i] * from_middle;
      sums.edge_yy += columns[5][i];
    }
  }
  return sums;
}

void BlobBox::Widen() {
  const uint8_t* mask = mask_.data() + stride_;
  for (size_t i = 0; i < size(); i += kLanes) {
    const Bytes16 more = LoadSixteen(mask + i) | Touching(mask + i, stride_);
    Store(own_.data() + i, LoadSixteen(gray_.data() + i) & more);
  }
  if (outside_ == 0) return;
  for (int row = 0; row < rows_; ++row) {
    uint8_t* own = own_.data() + row * stride_;
    const bool inside = row >= top_ && row < bottom_;
    std::memset(own, 0, static_cast<size_t>(inside ? left_ : stride_));
    if (inside) std::memset(own + right_, 0, static_cast<size_t>(stride_ - right_));
  }
}

}  // namespace taclink
