#pragma once

#include <Eigen/Core>
#include <array>

#include "sensing/shell/lanes.h"

namespace taclink {

/// Bilinear shape functions of four corners, counter-clockwise from (-1, -1).
struct ShapeFunctions {
  Eigen::Vector4d value, by_xi, by_eta;
};

inline ShapeFunctions ShapeFunctionsAt(double xi, double eta) {
  const Eigen::Array4d s(-1, 1, 1, -1), t(-1, -1, 1, 1);
  return {0.25 * (1 + s * xi) * (1 + t * eta), 0.25 * s * (1 + t * eta), 0.25 * t * (1 + s * xi)};
}

/// 2 x 2 Gauss points, all of weight 1, lie at +-kGauss.
inline constexpr double kGauss = 0.57735026918962576;
inline constexpr std::array<std::array<double, 2>, 4> kGaussPoints = {
    {{-kGauss, -kGauss}, {kGauss, -kGauss}, {kGauss, kGauss}, {-kGauss, kGauss}}};

/// The same at all Gauss points, by corner.
struct GaussShapes {
  GaussShapes() {
    for (size_t p = 0; p < 4; ++p) {
      const ShapeFunctions n = ShapeFunctionsAt(kGaussPoints[p][0], kGaussPoints[p][1]);
      for (size_t i = 0; i < 4; ++i) {
        const auto corner = static_cast<Eigen::Index>(i);
        value[i].Set(p, n.value[corner]);
        by_xi[i].Set(p, n.by_xi[corner]);
        by_eta[i].Set(p, n.by_eta[corner]);
      }
    }
  }

  std::array<Lanes, 4> value, by_xi, by_eta;
};
inline const GaussShapes& ShapesAtGaussPoints() {
  static const GaussShapes kShapes;
  return kShapes;
}

/// Sum of the corners' vectors (columns), weighted.
inline Lanes3 Interpolate(const Eigen::Matrix<double, 3, 4>& corners, const std::array<Lanes, 4>& weights) {
  Lanes3 sum;
  for (size_t a = 0; a < 3; ++a) {
    const auto row = static_cast<Eigen::Index>(a);
    sum[a] = (corners(row, 0) * weights[0] + corners(row, 1) * weights[1]) +
             (corners(row, 2) * weights[2] + corners(row, 3) * weights[3]);
  }
  return sum;
}

}  // namespace taclink
