#include <algorithm>
#include <cmath>
#include <cstring>

#include "sensing/markers/detect/detector_peaks.h"
#include "sensing/markers/detect/lanes.h"

namespace taclink {
namespace {

constexpr double kSettled = 0.05;  // px
constexpr int kSweeps = 3;
constexpr double kSlope = 0.005;  // of a background beside a marker, of its height a px
constexpr double kWindow = 6.5;   // squared radius of what a fit looks at, in sigmas

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
