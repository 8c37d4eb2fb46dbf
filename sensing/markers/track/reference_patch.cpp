#include "sensing/markers/track/reference_patch.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstring>

#include "sensing/markers/detect/lanes.h"

namespace taclink {
namespace {

constexpr int kTap = 2;                // the gradient reads so many pixels each way
constexpr int kSaturated = 250;        // such pixels don't grow with the light
constexpr float kMaxVariance = 0.01F;  // of a half shift per unit of noise: worse tells nothing
constexpr double kLeastGain = 0.3;
constexpr size_t kMaxPixels = 1024;

struct Sums {
  int difference = 0, reference = 0, gx = 0, gy = 0, square = 0;
};

// `count` is a multiple of 16, so that vector code has no rest.
Sums Correlate(const uint8_t* __restrict now, const uint8_t* __restrict reference,
               const int8_t* __restrict gx, const int8_t* __restrict gy, int count) {
  Sums s;
  for (int i = 0; i < count; ++i) {
    const auto r = static_cast<int16_t>(reference[i]);
    const auto d = static_cast<int16_t>(now[i] - r);
    s.difference += d;
    s.reference += r * d;
    s.gx += static_cast<int16_t>(gx[i]) * d;
    s.gy += static_cast<int16_t>(gy[i]) * d;
    s.square += d * d;
  }
  return s;
}

struct NormalSums {
  int count = 0, r = 0, x = 0, y = 0, rr = 0, rx = 0, ry = 0, xx = 0, xy = 0, yy = 0;
};

NormalSums SumNormal(const uint8_t* __restrict reference, const int8_t* __restrict gx,
                     const int8_t* __restrict gy, int count) {
  NormalSums n;
  for (int i = 0; i < count; ++i) {
    const int16_t r = reference[i], x = gx[i], y = gy[i];  // NOLINT(bugprone-signed-char-misuse): numbers
    n.count += reference[i] != 0 ? 1 : 0;
    n.r += r, n.x += x, n.y += y;
    n.rr += r * r, n.rx += r * x, n.ry += r * y;
    n.xx += x * x, n.xy += x * y, n.yy += y * y;
  }
  return n;
}

// Half of the derivative with an error of the fourth order: spots are only 3 px wide. Vector code: `mask` of
// a pixel is 0 or 255. A pixel in the mask has a reference of 1 at least, others 0.
void TakeBlock(const uint8_t* __restrict p, std::ptrdiff_t down, const uint8_t* __restrict mask,
               uint8_t* __restrict reference, int8_t* __restrict gx, int8_t* __restrict gy) {
  const auto half = [](int near, int far) {
    const auto wide = static_cast<int16_t>(8 * near - far);
    return static_cast<int8_t>(static_cast<int16_t>(wide * 2731 >> 16));
  };
  for (std::ptrdiff_t i = 0; i < 8; ++i) {
    const auto in = static_cast<uint8_t>(p[i] < kSaturated ? mask[i] : 0);
    reference[i] = static_cast<uint8_t>(std::max<uint8_t>(p[i], 1) & in);
    gx[i] = static_cast<int8_t>(half(p[i + 1] - p[i - 1], p[i + 2] - p[i - 2]) & in);
    gy[i] = static_cast<int8_t>(half(p[i + down] - p[i - down], p[i + 2 * down] - p[i - 2 * down]) & in);
  }
}

}  // namespace

ReferencePatch::ReferencePatch(int capacity_px)
    : capacity_(std::clamp((capacity_px + 15) / 16 * 16, 64, static_cast<int>(kMaxPixels))) {
  pixels_.resize(3 * static_cast<size_t>(capacity_));
}

bool ReferencePatch::Take(const cv::Mat& gray, const WindowBlob& blob, const Vec2& center_px) {
  Clear();
  center_px_ = center_px;
  x0_ = std::max(blob.x_begin - 1, kTap);
  blocks_ = (blob.x_end + 1 - x0_ + kBlock - 1) / kBlock;
  x0_ = std::min(x0_, gray.cols - kTap - kBlock * blocks_);
  y0_ = std::max(blob.y_begin - 1, kTap);
  const int height = std::min(blob.y_end + 1, gray.rows - kTap) - y0_;
  if (x0_ < kTap || blocks_ < 1 || height < 3) return false;
  const int most_rows = capacity_ / (kBlock * blocks_);
  if (most_rows < 3) return false;
  step_ = (height + most_rows - 1) / most_rows;
  rows_ = (height + step_ - 1) / step_;
  const int filled = rows_ * blocks_ * kBlock;
  count_ = (filled + 15) / 16 * 16;
  for (int row = 0; row < rows_; ++row) TakeRow(gray, blob, row);
  if (filled < count_) {
    std::memset(reference() + filled, 0, kBlock);
    std::memset(gx() + filled, 0, kBlock);
    std::memset(gy() + filled, 0, kBlock);
  }
  if (!Solve()) Clear();
  return !empty();
}

void ReferencePatch::TakeRow(const cv::Mat& gray, const WindowBlob& blob, int row) {
  const int y = y0_ + row * step_, rim_row = y - blob.window_y;
  const bool inside = rim_row >= 0 && rim_row < blob.window_height;
  const uint64_t rim = inside ? blob.rim[static_cast<size_t>(rim_row)] : 0;
  for (int block = 0; block < blocks_; ++block) {
    const int x = x0_ + block * kBlock, shift = x - blob.window_x;
    const uint64_t bits = shift >= 64 || shift <= -64 ? 0 : shift >= 0 ? rim >> shift : rim << -shift;
    const int first = (row * blocks_ + block) * kBlock;
    const uint64_t spread = SpreadBits(bits);
    std::array<uint8_t, kBlock> mask;
    std::memcpy(mask.data(), &spread, kBlock);
    TakeBlock(gray.ptr(y) + x, static_cast<std::ptrdiff_t>(gray.step[0]), mask.data(), reference() + first,
              gx() + first, gy() + first);
  }
}

bool ReferencePatch::Solve() {
  const NormalSums n = SumNormal(reference(), gx(), gy(), count_);
  used_ = n.count;
  Eigen::Matrix4d normal;
  normal << n.rr, n.r, n.rx, n.ry,  //
      n.r, n.count, n.x, n.y,       //
      n.rx, n.x, n.xx, n.xy,        //
      n.ry, n.y, n.xy, n.yy;
  Eigen::Matrix4d inverse;
  bool invertible = false;
  normal.computeInverseWithCheck(inverse, invertible, 1e-3);
  inverse_ = inverse.cast<float>();
  return invertible && used_ >= 9 && inverse_(2, 2) > 0 && inverse_(3, 3) > 0 &&
         inverse_(2, 2) < kMaxVariance && inverse_(3, 3) < kMaxVariance;
}

ReferencePatch::Shift ReferencePatch::Register(const cv::Mat& gray, const Vec2& expected_px) const {
  Shift shift;
  const Vec2 moved = expected_px - center_px_;
  if (empty() || !(moved.cwiseAbs().maxCoeff() < 4096)) return shift;
  const auto dx = static_cast<int>(std::lround(moved.x())), dy = static_cast<int>(std::lround(moved.y()));
  const int x0 = x0_ + dx, y0 = y0_ + dy;
  if (x0 < 0 || y0 < 0 || x0 + blocks_ * kBlock > gray.cols || y0 + (rows_ - 1) * step_ >= gray.rows) {
    return shift;
  }
  alignas(16) std::array<uint8_t, kMaxPixels> now;
  size_t at = 0;
  for (int row = 0; row < rows_; ++row) {
    const uint8_t* p = gray.ptr(y0 + row * step_) + x0;
    for (int block = 0; block < blocks_; ++block, p += kBlock, at += kBlock) {
      std::memcpy(now.data() + at, p, kBlock);
    }
  }
  for (size_t i = 0; i < static_cast<size_t>(count_); i += sizeof(Bytes16)) {
    const auto mask = reinterpret_cast<Bytes16>(LoadSixteen(reference() + i) != 0);
    const Bytes16 masked = LoadSixteen(now.data() + i) & mask;
    std::memcpy(now.data() + i, &masked, sizeof masked);
  }
  const Sums s = Correlate(now.data(), reference(), gx(), gy(), count_);
  const Eigen::Vector4f right(static_cast<float>(s.reference), static_cast<float>(s.difference),
                              static_cast<float>(s.gx), static_cast<float>(s.gy));
  const Eigen::Vector4f fit = inverse_ * right;
  shift.gain = 1 + static_cast<double>(fit[0]);
  if (!(shift.gain > kLeastGain)) return shift;
  shift.residual2 = std::max(0.0F, static_cast<float>(s.square) - right.dot(fit)) / static_cast<float>(used_);
  const Vec2 sub(-fit[2] / (2 * shift.gain), -fit[3] / (2 * shift.gain));
  shift.center_px = center_px_ + Vec2(dx, dy) + sub;
  shift.off_whole_px = sub.cwiseAbs().maxCoeff();
  shift.valid = sub.allFinite();
  return shift;
}

}  // namespace taclink
