#include "sensing/shell/element_load.h"
#include "sensing/shell/shape_functions.h"

namespace taclink {
namespace {

Mat3 Skew(const Vec3& v) {
  Mat3 m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

}  // namespace

// Volume = 1/3 sum X . (X_xi x X_eta) over Gauss points, X the surface's points; differentiated by its
// corners. The second derivative by corners i and j is the cross product with a vector, and minus that vector
// for j and i.
void FollowerPressure::Add(DerivativeOrder order, int /*element*/, const ElementState& state,
                           ElementResponse& response) const {
  Eigen::Matrix<double, 3, 4> corners;
  for (Eigen::Index i = 0; i < 4; ++i) corners.col(i) = state.segment<3>(6 * i);
  const auto& [value, by_xi, by_eta] = ShapesAtGaussPoints();
  const Lanes3 x = Interpolate(corners, value), x1 = Interpolate(corners, by_xi),
               x2 = Interpolate(corners, by_eta);
  const Lanes3 area = Cross(x1, x2);
  const double scale = -pressure_mpa_ / 3;
  response.energy_nmm += scale * Sum(Dot(x, area));
  if (order == DerivativeOrder::kEnergy) return;
  const Lanes3 side1 = Cross(x2, x), side2 = Cross(x, x1);
  for (size_t i = 0; i < 4; ++i) {
    Vec3 force;
    for (size_t a = 0; a < 3; ++a) {
      force[static_cast<Eigen::Index>(a)] =
          scale * Sum(value[i] * area[a] + by_xi[i] * side1[a] + by_eta[i] * side2[a]);
    }
    response.gradient.segment<3>(static_cast<Eigen::Index>(6 * i)) += force;
  }
  if (order == DerivativeOrder::kGradient) return;
  for (size_t i = 0; i < 4; ++i) {
    for (size_t j = i + 1; j < 4; ++j) {
      const Lanes by_x1 = value[i] * by_eta[j] - by_eta[i] * value[j];
      const Lanes by_x2 = by_xi[i] * value[j] - value[i] * by_xi[j];
      const Lanes by_x = by_eta[i] * by_xi[j] - by_xi[i] * by_eta[j];
      Vec3 turning;
      for (size_t a = 0; a < 3; ++a)
        turning[static_cast<Eigen::Index>(a)] = scale * Sum(by_x1 * x1[a] + by_x2 * x2[a] + by_x * x[a]);
      const auto row = static_cast<Eigen::Index>(6 * i), column = static_cast<Eigen::Index>(6 * j);
      response.hessian.block<3, 3>(row, column) += Skew(turning);
      response.hessian.block<3, 3>(column, row) -= Skew(turning);
    }
  }
}

}  // namespace taclink
