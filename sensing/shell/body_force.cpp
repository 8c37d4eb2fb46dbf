#include "sensing/shell/body_force.h"

#include "sensing/shell/shape_functions.h"

namespace taclink {

std::vector<Eigen::Vector4d> CornerAreas(const ShellSurface& surface) {
  std::vector<Eigen::Vector4d> areas_mm2;
  for (const std::array<int, 4>& element : surface.elements) {
    Eigen::Matrix<double, 3, 4> corners;
    for (Eigen::Index i = 0; i < 4; ++i)
      corners.col(i) = surface.mids_mm[static_cast<size_t>(element[static_cast<size_t>(i)])];
    Eigen::Vector4d shares = Eigen::Vector4d::Zero();
    for (const auto& [xi, eta] : kGaussPoints) {
      const ShapeFunctions n = ShapeFunctionsAt(xi, eta);
      const Vec3 by_xi = corners * n.by_xi, by_eta = corners * n.by_eta;
      shares += by_xi.cross(by_eta).norm() * n.value;
    }
    areas_mm2.push_back(shares);
  }
  return areas_mm2;
}

void BodyForce::Add(DerivativeOrder order, int element, const ElementState& state,
                    ElementResponse& response) const {
  const Eigen::Vector4d& areas_mm2 = (*corner_areas_mm2_)[static_cast<size_t>(element)];
  for (Eigen::Index i = 0; i < 4; ++i) {
    const Vec3 force_n = areas_mm2[i] * force_n_per_mm2_;
    response.energy_nmm -= force_n.dot(state.segment<3>(6 * i));
    if (order != DerivativeOrder::kEnergy) response.gradient.segment<3>(6 * i) -= force_n;
  }
}

}  // namespace taclink
