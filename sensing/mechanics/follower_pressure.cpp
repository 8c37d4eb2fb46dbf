#include "sensing/mechanics/element_load.h"
#include "sensing/mechanics/shape_functions.h"

namespace taclink {
namespace {

Mat3 Skew(const Vec3& v) {
  Mat3 m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

}  // namespace

// Volume = 1/3 sum X . (X_xi x X_eta) over Gauss points, X the wall's points; differentiated by its corners.
void FollowerPressure::Add(DerivativeOrder order, int /*element*/, const ElementState& state,
                           ElementResponse& response) const {
  Eigen::Matrix<double, 3, 4> wall;
  for (Eigen::Index i = 0; i < 4; ++i) {
    wall.col(i) = state.segment<3>(6 * i) - half_thickness_mm_ * state.segment<3>(6 * i + 3);
  }
  const double scale = -pressure_mpa_ / 3;
  const double by_director = -half_thickness_mm_;
  for (const double xi : {-kGauss, kGauss}) {
    for (const double eta : {-kGauss, kGauss}) {
      const ShapeFunctions n = ShapeFunctionsAt(xi, eta);
      const Vec3 x = wall * n.value, x1 = wall * n.by_xi, x2 = wall * n.by_eta;
      const Vec3 area = x1.cross(x2), side1 = x2.cross(x), side2 = x.cross(x1);
      response.energy_nmm += scale * x.dot(area);
      if (order == DerivativeOrder::kEnergy) continue;
      for (Eigen::Index i = 0; i < 4; ++i) {
        const Vec3 force = scale * (n.value[i] * area + n.by_xi[i] * side1 + n.by_eta[i] * side2);
        response.gradient.segment<3>(6 * i) += force;
        response.gradient.segment<3>(6 * i + 3) += by_director * force;
      }
      if (order == DerivativeOrder::kGradient) continue;
      const Mat3 k0 = scale * Skew(x), k1 = scale * Skew(x1), k2 = scale * Skew(x2);
      for (Eigen::Index i = 0; i < 4; ++i) {
        for (Eigen::Index j = 0; j < 4; ++j) {
          const Mat3 k = (n.value[i] * n.by_eta[j] - n.by_eta[i] * n.value[j]) * k1 +
                         (n.by_xi[i] * n.value[j] - n.value[i] * n.by_xi[j]) * k2 +
                         (n.by_eta[i] * n.by_xi[j] - n.by_xi[i] * n.by_eta[j]) * k0;
          response.hessian.block<3, 3>(6 * i, 6 * j) += k;
          response.hessian.block<3, 3>(6 * i, 6 * j + 3) += by_director * k;
          response.hessian.block<3, 3>(6 * i + 3, 6 * j) += by_director * k;
          response.hessian.block<3, 3>(6 * i + 3, 6 * j + 3) += by_director * by_director * k;
        }
      }
    }
  }
}

}  // namespace taclink
