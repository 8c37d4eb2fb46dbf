#pragma once

#include <array>
#include <cstddef>

namespace taclink {

/// One number for each of an element's four in-plane Gauss points, so that one instruction serves two of
/// them: the vectors of GCC and Clang that every processor has.
class Lanes {
 public:
  Lanes() = default;
  /// Not explicit: a number is the same at all points.
  Lanes(double all) : low_{all, all}, high_{all, all} {}

  double operator[](size_t point) const { return point < 2 ? low_[point] : high_[point - 2]; }
  void Set(size_t point, double value) {
    Pair& pair = point < 2 ? low_ : high_;
    pair[point % 2] = value;
  }
  void Write(double* to) const {
    for (size_t point = 0; point < 2; ++point) {
      to[point] = low_[point];
      to[point + 2] = high_[point];
    }
  }

  friend Lanes operator+(const Lanes& a, const Lanes& b) { return {a.low_ + b.low_, a.high_ + b.high_}; }
  friend Lanes operator-(const Lanes& a, const Lanes& b) { return {a.low_ - b.low_, a.high_ - b.high_}; }
  friend Lanes operator*(const Lanes& a, const Lanes& b) { return {a.low_ * b.low_, a.high_ * b.high_}; }
  friend Lanes operator/(const Lanes& a, const Lanes& b) { return {a.low_ / b.low_, a.high_ / b.high_}; }
  Lanes operator-() const { return {-low_, -high_}; }
  Lanes& operator+=(const Lanes& other) { return *this = *this + other; }

  friend double Sum(const Lanes& x) {
    const Pair pair = x.low_ + x.high_;
    return pair[0] + pair[1];
  }

 private:
  using Pair = double __attribute__((vector_size(16)));
  Lanes(Pair low, Pair high) : low_(low), high_(high) {}

  Pair low_{}, high_{};
};

/// Three of them: a vector or the strains 11, 22, 12 of every point.
using Lanes3 = std::array<Lanes, 3>;

inline Lanes Dot(const Lanes3& a, const Lanes3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline Lanes3 Cross(const Lanes3& a, const Lanes3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

}  // namespace taclink
