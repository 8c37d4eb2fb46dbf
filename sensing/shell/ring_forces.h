#pragma once

#include <array>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// What an element's internal forces are made of at one Gauss point: with c the covariant strains e11, e22,
/// 2 e12 and t the tying shears, the forces by c are `membrane` c + `coupling` t (and the in-plane law's,
/// where that is not linear).
struct RingPoint {
  std::array<double, 6> membrane{};  ///< N mm, symmetric: 00, 11, 22, 01, 02, 12
  std::array<std::array<double, 4>, 3> coupling{};
  std::array<double, 3> rest_metric{};  ///< g11, g22, 2 g12 at rest, mm^2
  // Only for a law that is not linear, whose part `membrane` is then without.
  double weight_mm3 = 0;
  std::array<std::array<double, 3>, 3> in_plane{};  ///< c to Cartesian strains
};

/// One ring of equal elements around the axis.
struct RingCoefficients {
  std::array<double, 2> heights_mm{};  ///< of the layers of Gauss points above the mid-surface
  std::array<std::array<RingPoint, 4>, 2> points{};
  std::array<std::array<double, 4>, 4> tying_stiffness{};  ///< N mm
  std::array<double, 4> rest_tying_mm{};
};

/// Numbers by node of a mesh of revolution, node by node around within a row, so that neighbors around the
/// axis are neighbors in memory: six by node, those of the mid-surface and those of the director. The first
/// columns of a row are repeated behind its last, up to `stride`.
class RingField {
 public:
  static constexpr int kComponents = 6;
  /// Repeated: as many as the widest vector has lanes.
  static constexpr int kRepeated = 8;

  void Resize(int rows, int columns) {
    columns_ = columns;
    stride_ = columns + kRepeated;
    values_.resize(static_cast<size_t>(rows * kComponents * stride_));
  }
  int columns() const { return columns_; }
  int stride() const { return stride_; }
  double* data() { return values_.data(); }
  const double* data() const { return values_.data(); }
  double* At(int row, int component) {
    return values_.data() + static_cast<ptrdiff_t>((row * kComponents + component) * stride_);
  }
  const double* At(int row, int component) const {
    return values_.data() + static_cast<ptrdiff_t>((row * kComponents + component) * stride_);
  }
  Vec3 Mid(int row, int column) const { return Three(row, 0, column); }
  Vec3 Director(int row, int column) const { return Three(row, 3, column); }

 private:
  Vec3 Three(int row, int first, int column) const {
    return {At(row, first)[column], At(row, first + 1)[column], At(row, first + 2)[column]};
  }

  int columns_ = 0, stride_ = 0;
  std::vector<double> values_;
};

/// Elements of a shell that is a surface of revolution at rest, in any state, under pressure. One ring's
/// elements share their coefficients, and a vector's lanes are neighbors around the axis: AVX-512, AVX2 or
/// what every processor has, chosen when the program runs.
struct RingElements {
  double thickness_mm = 0;
  Material material;
  std::vector<RingCoefficients> rings;

  /// Stored energy and that of the pressure (FollowerPressure), N mm. `state`: points in mm and unit
  /// directors, with the repeated columns. `forces`: by those, N and N mm; null: not wanted. Where the
  /// material law has no answer the energy is infinite and forces are NaN.
  double Forces(const RingField& state, double pressure_mpa, RingField* forces) const;
};

}  // namespace taclink
