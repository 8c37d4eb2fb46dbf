#include "sensing/markers/reference_patch.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstring>

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

// 255 for each set bit, 0 for others.
uint64_t SpreadBits(uint64_t eight) {
  const uint64_t picked = (eight & 255) * 0x0101010101010101ULL & 0x8040201008040201ULL;
  return (((picked + 0x7f7f7f7f7f7f7f7fULL) | picked) >> 7 & 0x0101010101010101ULL) * 255;
}

// Half of the derivative with an error of the fourth order: spots are only 3 px wide. Vector code: `mask` of
// a pixel is 0 or 255.
void TakeBlock(const uint8_t* __restrict p, std::ptrdiff_t down, uint8_t* __restrict mask,
               uint8_t* __restrict reference, int8_t* __restrict gx, int8_t* __restrict gy) {
  const auto half = [](int near, int far) { return static_cast<int8_t>((8 * near - far) * 2731 >> 16); };
  for (std::ptrdiff_t i = 0; i < 8; ++i) {
    const auto in = static_cast<uint8_t>(p[i] < kSaturated ? mask[i] : 0);
    mask[i] = in;
    reference[i] = static_cast<uint8_t>(p[i] & in);
    gx[i] = static_cast<int8_t>(half(p[i + 1] - p[i - 1], p[i + 2] - p[i - 2]) & in);
    gy[i] = static_cast<int8_t>(half(p[i + down] - p[i - down], p[i + 2 * down] - p[i - 2 * down]) & in);
  }
}

}  // namespace

ReferencePatch::ReferencePatch(int capacity_px)
    : capacity_(std::clamp((capacity_px + 15) / 16 * 16, 64, static_cast<int>(kMaxPixels))) {
  const auto size = static_cast<size_t>(capacity_);
  reference_.resize(size);
  mask_.resize(size);
  gx_.resize(size);
  gy_.resize(size);
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
  for (int row = 0; row < rows_; ++row) TakeRow(gray, blob, row);
  count_ = rows_ * blocks_ * kBlock;
  while (count_ % 16 != 0) {
    const auto i = static_cast<size_t>(count_++);
    reference_[i] = mask_[i] = 0;
    gx_[i] = gy_[i] = 0;
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
    const auto at = static_cast<size_t>(first);
    const uint64_t mask = SpreadBits(bits);
    std::memcpy(mask_.data() + at, &mask, kBlock);
    TakeBlock(gray.ptr(y) + x, static_cast<std::ptrdiff_t>(gray.step[0]), mask_.data() + at,
              reference_.data() + at, gx_.data() + at, gy_.data() + at);
  }
}

bool ReferencePatch::Solve() {
  used_ = 0;
  int r = 0, rr = 0, x = 0, y = 0, rx = 0, ry = 0, xx = 0, xy = 0, yy = 0;
  for (size_t i = 0; i < static_cast<size_t>(count_); ++i) {
    const int a = reference_[i], b = gx_[i], c = gy_[i];  // NOLINT(bugprone-signed-char-misuse): numbers
    used_ += mask_[i] & 1;
    r += a, x += b, y += c;
    rr += a * a, rx += a * b, ry += a * c;
    xx += b * b, xy += b * c, yy += c * c;
  }
  Eigen::Matrix4d normal;
  normal << rr, r, rx, ry,  //
      r, used_, x, y,       //
      rx, x, xx, xy,        //
      ry, y, xy, yy;
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
      uint64_t pixels = 0, mask = 0;
      std::memcpy(&pixels, p, kBlock);
      std::memcpy(&mask, mask_.data() + at, kBlock);
      pixels &= mask;
      std::memcpy(now.data() + at, &pixels, kBlock);
    }
  }
  if (at < static_cast<size_t>(count_)) std::memset(now.data() + at, 0, kBlock);
  const Sums s = Correlate(now.data(), reference_.data(), gx_.data(), gy_.data(), count_);
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
