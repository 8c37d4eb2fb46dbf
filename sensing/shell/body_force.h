#pragma once

#include <Eigen/Core>
#include <vector>

#include "sensing/shell/nonlinear_shell.h"

namespace taclink {

/// The area at rest for which each corner of an element stands (integral of its shape function), mm^2.
std::vector<Eigen::Vector4d> CornerAreas(const ShellSurface& surface);

/// A force that goes with the skin's mass, constant in direction and size: weight, inertia. Per area of the
/// undeformed mid-surface, since deformation does not change an element's mass; therefore linear in the
/// displacements, with the potential -f x and no tangent.
class BodyForce final : public ElementLoad {
 public:
  /// `corner_areas_mm2` is referred to. `force_n_per_mm2`: in the shell's frame.
  BodyForce(const std::vector<Eigen::Vector4d>& corner_areas_mm2, const Vec3& force_n_per_mm2)
      : corner_areas_mm2_(&corner_areas_mm2), force_n_per_mm2_(force_n_per_mm2) {}
  void Add(DerivativeOrder order, int element, const ElementState& state,
           ElementResponse& response) const override;

 private:
  const std::vector<Eigen::Vector4d>* corner_areas_mm2_;
  Vec3 force_n_per_mm2_;
};

}  // namespace taclink
