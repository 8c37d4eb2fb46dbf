#include "sensing/markers/detector_peaks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "sensing/markers/lanes.h"

namespace taclink {
namespace {

constexpr int kReach = 7;               // px, within which a maximum falls off
constexpr double kDip = 0.06;           // of the height: deeper ones part two summits
constexpr double kWiggle = 2.5;         // sigmas of the noise that no dip is
constexpr double kSettled = 0.05;       // px
constexpr double kSmoothNoise = 0.375;  // of the binomial mean, over a pixel's
constexpr int kScale = 16;              // of smoothed levels
constexpr int kTogether = 8;            // pixels
constexpr int kSweeps = 3;
constexpr double kSlope = 0.005;  // of a background beside a marker, of its height a px
constexpr double kWindow = 6.5;   // squared radius of what a fit looks at, in sigmas

struct Step {
  int dx, dy;
};
constexpr std::array<Step, 8> kAround = {
    {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}}};

Floats4 LoadFloats(const float* p) {
  Floats4 four;
  std::memcpy(&four, p, sizeof four);
  return four;
}

// exp(v) of v <= 0, to 1e-5 of it: 2^x by x's whole part and a series for what is left, within half.
Floats4 Exp(Floats4 v) {
  const Floats4 least = Floats4{} - 80, most{};
  v = v > least ? v : least;
  const Floats4 x = 1.44269504F * (v < most ? v : most);
  const Ints4 whole = __builtin_convertvector(x - 0.5F, Ints4);
  const Floats4 f = x - __builtin_convertvector(whole, Floats4);
  const Floats4 series =
      1 + f * (0.69314718F + f * (0.24022651F + f * (0.05550411F + f * (0.00961813F + f * 0.00133336F))));
  return reinterpret_cast<Floats4>(reinterpret_cast<Ints4>(series) + (whole << 23));
}

// -d' precision d / 2 of a bell; pixels count from another place.
struct Exponent {
  Exponent(const Bell& bell, const Vec2& from)
      : ox(Floats4{} + static_cast<float>(bell.center_px.x() - from.x())),
        oy(Floats4{} + static_cast<float>(bell.center_px.y() - from.y())),
        xx(Floats4{} + static_cast<float>(-0.5 * bell.precision(0, 0))),
        xy(Floats4{} + static_cast<float>(-bell.precision(0, 1))),
        yy(Floats4{} + static_cast<float>(-0.5 * bell.precision(1, 1))) {}

  Floats4 operator()(Floats4 x, Floats4 y) const {
    const Floats4 dx = x - ox, dy = y - oy;
    return dx * (xx * dx + xy * dy) + yy * dy * dy;
  }

  Floats4 ox, oy, xx, xy, yy;
};

// Cholesky's factors into a symmetric matrix' lower half, the solution into the right side.
template <int n>
bool SolveInPlace(Eigen::Matrix<double, n, n>& a, Eigen::Matrix<double, n, 1>& b) {
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k <= i; ++k) {
      double sum = a(i, k);
      for (int j = 0; j < k; ++j) sum -= a(i, j) * a(k, j);
      if (k < i) {
        a(i, k) = sum * a(k, k);
      } else if (!(sum > 0)) {
        return false;
      } else {
        a(i, i) = 1 / std::sqrt(sum);  // the inverse is kept
      }
    }
    for (int j = 0; j < i; ++j) b[i] -= a(i, j) * b[j];
    b[i] *= a(i, i);
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int j = i + 1; j < n; ++j) b[i] -= a(j, i) * b[j];
    b[i] *= a(i, i);
  }
  return b.allFinite();
}

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

// Those whose light reaches into each other's windows. Bells come by rising y, but for the split levels'
// ones.
void BellFinder::FindNeighbours() {
  neighbours_.clear();
  first_neighbour_.assign(bells_.size() + 1, 0);
  const auto reach = [](const Bell& b) {
    return std::min(2.2 / std::sqrt(std::min(b.precision(0, 0), b.precision(1, 1))), 9.0);
  };
  places_.clear();
  for (const Bell& b : bells_)
    places_.push_back({static_cast<float>(b.center_px.x()), static_cast<float>(b.center_px.y())});
  for (size_t i = 0; i < bells_.size(); ++i) {
    first_neighbour_[i] = static_cast<int>(neighbours_.size());
    if (bells_[i].known) continue;
    const Place here = places_[i];
    const double own = reach(bells_[i]);
    for (size_t k = 0; k < bells_.size(); ++k) {
      const float down = std::abs(places_[k].y - here.y), aside = std::abs(places_[k].x - here.x);
      if (down > 18 || aside > 18 || k == i) continue;
      const double limit = own + reach(bells_[k]);
      if (down * down + aside * aside < limit * limit)
        neighbours_.push_back({static_cast<int>(i), static_cast<int>(k)});
    }
  }
  first_neighbour_[bells_.size()] = static_cast<int>(neighbours_.size());
}

void BellFinder::Fit() {
  FindNeighbours();
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (size_t i = 0; i < bells_.size(); ++i) {
      if (!bells_[i].known && !bells_[i].settled) Improve(i);
    }
  }
}

// The pixels within the bell's ellipse, less the other bells.
bool BellFinder::LookAt(size_t index, double radius_squared) {
  const Bell& bell = bells_[index];
  const double pxx = bell.precision(0, 0), pxy = bell.precision(0, 1), pyy = bell.precision(1, 1);
  const double det = pxx * pyy - pxy * pxy;
  if (!(det > 1e-4)) return false;
  dx_.resize(kMaxPixels), dy_.resize(kMaxPixels), value_.resize(kMaxPixels);
  Eigen::Index n = 0;
  const double reach_y = std::sqrt(radius_squared * pxx / det);
  const int y0 = std::max(0, static_cast<int>(std::ceil(bell.center_px.y() - reach_y))),
            y1 = std::min(gray_.rows - 1, static_cast<int>(std::floor(bell.center_px.y() + reach_y)));
  for (int y = y0; y <= y1; ++y) {
    // The ellipse cuts the row where pxx dx^2 + 2 pxy dx dy + pyy dy^2 = radius_squared.
    const double v = y - bell.center_px.y();
    const double root = std::sqrt(std::max(0.0, pxy * pxy * v * v - pxx * (pyy * v * v - radius_squared)));
    const double middle = bell.center_px.x() - pxy * v / pxx;
    const int x0 = std::max(0, static_cast<int>(std::ceil(middle - root / pxx))),
              x1 = std::min(gray_.cols - 1, static_cast<int>(std::floor(middle + root / pxx)));
    if (x1 < x0) continue;
    if (n + x1 - x0 + 4 > kMaxPixels) return false;
    const uint8_t* row = gray_.ptr(y);
    const auto from = static_cast<float>(bell.center_px.x());
    const Floats4 steps = {0, 1, 2, 3}, down = Floats4{} + static_cast<float>(v);
    // Four at a time: what is too much, the next row writes over.
    for (int x = x0; x <= x1; x += 4) {
      const Eigen::Index at = n + x - x0;
      const Floats4 aside = steps + (static_cast<float>(x) - from);
      std::memcpy(dx_.data() + at, &aside, sizeof aside);
      std::memcpy(dy_.data() + at, &down, sizeof down);
      uint32_t four = 0;
      std::memcpy(&four, row + std::min(x, gray_.cols - 4), sizeof four);
      const Floats4 levels = FourFloats(four >> (8 * (x - std::min(x, gray_.cols - 4))));
      std::memcpy(value_.data() + at, &levels, sizeof levels);
    }
    n += x1 - x0 + 1;
  }
  if (n < 12) return false;
  dx_.conservativeResize(n), dy_.conservativeResize(n), value_.conservativeResize(n);
  for (int i = first_neighbour_[index]; i < first_neighbour_[index + 1]; ++i) {
    const Bell& other = bells_[static_cast<size_t>(neighbours_[static_cast<size_t>(i)].other)];
    if (!other.good) continue;
    TakeAway(other, bell.center_px);
  }
  Shape(bell, bell.center_px, shape_);
  return true;
}

void BellFinder::Shape(const Bell& bell, const Vec2& from, Pixels& out) const {
  const Exponent exponent(bell, from);
  const Eigen::Index n = dx_.size();
  out.resize(n);
  for (Eigen::Index i = 0; i < n; i += 4) {
    const Floats4 e = Exp(exponent(LoadFloats(dx_.data() + i), LoadFloats(dy_.data() + i)));
    std::memcpy(out.data() + i, &e, sizeof e);  // there is room for what is too much
  }
}

// The bell's light from value_.
void BellFinder::TakeAway(const Bell& bell, const Vec2& from) {
  const Exponent exponent(bell, from);
  const Floats4 height = Floats4{} + static_cast<float>(bell.height);
  for (Eigen::Index i = 0; i < dx_.size(); i += 4) {
    const Floats4 left = LoadFloats(value_.data() + i) -
                         height * Exp(exponent(LoadFloats(dx_.data() + i), LoadFloats(dy_.data() + i)));
    std::memcpy(value_.data() + i, &left, sizeof left);
  }
}

// A Gauss-Newton step with the other bells held. The window is even about the centre, so that the even and
// the odd parameters are solved for apart.
void BellFinder::Improve(size_t index) {
  Bell& bell = bells_[index];
  bell.good = false;
  if (!LookAt(index, kWindow)) return;
  const double pxx = bell.precision(0, 0), pxy = bell.precision(0, 1), pyy = bell.precision(1, 1);
  const auto height = static_cast<float>(bell.height);
  const auto fxx = static_cast<float>(pxx), fxy = static_cast<float>(pxy), fyy = static_cast<float>(pyy);
  const Pixels& e = shape_;
  const Pixels he = height * e, hx = he * dx_, hy = he * dy_;
  const Pixels left = value_ - static_cast<float>(bell.base) - he - static_cast<float>(bell.slope.x()) * dx_ -
                      static_cast<float>(bell.slope.y()) * dy_;
  const Pixels sxx = hx * dx_, sxy = hx * dy_, syy = hy * dy_;
  const auto dot = [](const Pixels& a, const Pixels& b) { return static_cast<double>((a * b).sum()); };
  const auto n = static_cast<double>(e.size());
  // Even: height, base, and precision.
  Eigen::Matrix<double, 5, 5> even;
  even.setZero();
  const double exx = dot(e, sxx), exy = dot(e, sxy), eyy = dot(e, syy);
  even(0, 0) = dot(e, e);
  even(1, 0) = static_cast<double>(e.sum()), even(1, 1) = n;
  even(2, 0) = -0.5 * exx, even(2, 1) = -0.5 * static_cast<double>(sxx.sum());
  even(3, 0) = -exy, even(3, 1) = -static_cast<double>(sxy.sum());
  even(4, 0) = -0.5 * eyy, even(4, 1) = -0.5 * static_cast<double>(syy.sum());
  const double xxyy = dot(sxx, syy);
  // The shape stays near what it is unless the pixels insist.
  const double hold = 4 * noise_ * noise_;
  even(2, 2) = 0.25 * dot(sxx, sxx) + hold / (pxx * pxx);
  even(3, 2) = 0.5 * dot(sxx, sxy), even(3, 3) = xxyy + hold / (pxx * pyy);
  even(4, 2) = 0.25 * xxyy, even(4, 3) = 0.5 * dot(syy, sxy),
          even(4, 4) = 0.25 * dot(syy, syy) + hold / (pyy * pyy);
  Eigen::Matrix<double, 5, 1> right(dot(e, left), static_cast<double>(left.sum()), -0.5 * dot(sxx, left),
                                    -dot(sxy, left), -0.5 * dot(syy, left));
  if (!SolveInPlace(even, right)) return;
  // Odd: slope and centre.
  const Pixels gx = fxx * hx + fxy * hy, gy = fxy * hx + fyy * hy;
  Eigen::Matrix<double, 4, 4> odd;
  odd.setZero();
  const double slope_hold = noise_ * noise_ / (kSlope * kSlope * std::max(1.0, bell.height * bell.height));
  odd(0, 0) = dot(dx_, dx_) + slope_hold, odd(1, 0) = dot(dx_, dy_), odd(1, 1) = dot(dy_, dy_) + slope_hold;
  odd(2, 0) = dot(gx, dx_), odd(2, 1) = dot(gx, dy_), odd(2, 2) = dot(gx, gx);
  odd(3, 0) = dot(gy, dx_), odd(3, 1) = dot(gy, dy_), odd(3, 2) = dot(gx, gy), odd(3, 3) = dot(gy, gy);
  Eigen::Matrix<double, 4, 1> odd_right(dot(dx_, left) - slope_hold * bell.slope.x(),
                                        dot(dy_, left) - slope_hold * bell.slope.y(), dot(gx, left),
                                        dot(gy, left));
  if (!SolveInPlace(odd, odd_right)) return;

  bell.height += right[0];
  bell.base += right[1];
  bell.slope += odd_right.head<2>();
  const double longest = std::max(std::abs(odd_right[2]), std::abs(odd_right[3]));
  bell.center_px += odd_right.tail<2>() * std::min(1.0, 0.7 / std::max(longest, 1e-9));
  const double part = std::min(
      {1.0, 0.4 * pxx / std::max(1e-9, std::abs(right[2])), 0.4 * pyy / std::max(1e-9, std::abs(right[4]))});
  bell.precision(0, 0) += part * right[2];
  bell.precision(1, 1) += part * right[4];
  const double limit = 0.9 * std::sqrt(bell.precision(0, 0) * bell.precision(1, 1));
  bell.precision(0, 1) = bell.precision(1, 0) = std::clamp(pxy + part * right[3], -limit, limit);
  bell.good = bell.height > 0;
  bell.settled =
      longest < kSettled && part == 1 && std::abs(right[2]) < 0.1 * pxx && std::abs(right[4]) < 0.1 * pyy;
  bell.misfit = std::sqrt(static_cast<double>(left.square().sum()) / n);
}

}  // namespace taclink
