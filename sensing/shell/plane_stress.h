#pragma once

#include "sensing/core/link_model.h"
#include "sensing/shell/lanes.h"

namespace taclink {

/// Answer of a sheet in plane stress at four points. In-plane components in the order 11, 22, 12 of a
/// Cartesian frame.
struct PlaneStress {
  Lanes energy_mpa;   ///< stored, per reference volume (N mm / mm^3)
  Lanes3 stress_mpa;  ///< second Piola-Kirchhoff: the energy's derivative by the strain
  /// Its second derivative, symmetric: 1111, 2222, 1212, 1122, 1112, 2212.
  std::array<Lanes, 6> tangent_mpa;
};

/// `strain`: Green-Lagrange E11, E22, 2 E12. The laws are those of [holzapfel2000].
/// Saint Venant-Kirchhoff: linear between the two, any Poisson's ratio. Neo-Hookean, incompressible:
/// W = mu/2 (tr C + 1 / det C - 3) with C = 1 + 2 E in the plane, the thickness following from det F = 1.
/// Where C is not positive definite there is no such sheet: the energy is infinite and the rest NaN.
void PlaneStressOf(const Material& material, const Lanes3& strain, PlaneStress& answer);

/// An element's extent in one direction.
struct ElementSpan {
  double length_mm = 0;
  double curvature_across_per_mm = 0;  ///< of the shell at rest, in the other direction
};

/// For transverse shears in the direction of `span`: stress by engineering strain, shear correction included,
/// and what the element is too stiff in bending by (residual bending flexibility [macneal1978]; its reduction
/// where the shell is curved is this project's own). See mitc4.md.
double TransverseShearModulus(const Material& material, double thickness_mm, const ElementSpan& span);

}  // namespace taclink
