#pragma once

#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// Answer of a sheet in plane stress. In-plane components in the order 11, 22, 12 of a Cartesian frame.
struct PlaneStress {
  double energy_mpa = 0;  ///< stored, per reference volume (N mm / mm^3)
  Vec3 stress_mpa;        ///< second Piola-Kirchhoff: the energy's derivative by the strain
  Mat3 tangent_mpa;       ///< its second derivative
};

/// `strain`: Green-Lagrange E11, E22, 2 E12.
/// Saint Venant-Kirchhoff: linear between the two, any Poisson's ratio. Neo-Hookean, incompressible:
/// W = mu/2 (tr C + 1 / det C - 3) with C = 1 + 2 E in the plane, the thickness following from det F = 1.
/// Where C is not positive definite there is no such sheet: the energy is infinite and the rest NaN.
PlaneStress PlaneStressOf(const Material& material, const Vec3& strain);

/// For transverse shears: stress by engineering strain, shear correction included.
double TransverseShearModulus(const Material& material);

}  // namespace taclink
