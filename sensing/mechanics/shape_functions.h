#pragma once

#include <Eigen/Core>

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

}  // namespace taclink
