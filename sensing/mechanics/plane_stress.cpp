#include "sensing/mechanics/plane_stress.h"

#include <limits>

namespace taclink {
namespace {

constexpr double kShearCorrection = 5.0 / 6.0;

PlaneStress SaintVenantKirchhoff(const Material& material, const Vec3& strain) {
  const double nu = material.poisson_ratio;
  const double c = material.youngs_modulus_mpa / (1 - nu * nu);
  PlaneStress result;
  result.tangent_mpa << c, c * nu, 0, c * nu, c, 0, 0, 0, c * (1 - nu) / 2;
  result.stress_mpa = result.tangent_mpa * strain;
  result.energy_mpa = 0.5 * strain.dot(result.stress_mpa);
  return result;
}

PlaneStress NeoHookean(const Material& material, const Vec3& strain) {
  const double mu = material.youngs_modulus_mpa / 3;
  const double c11 = 1 + 2 * strain[0], c22 = 1 + 2 * strain[1], c12 = strain[2];
  const double det = c11 * c22 - c12 * c12;
  PlaneStress result;
  if (!(det > 0 && c11 > 0)) {
    result.energy_mpa = std::numeric_limits<double>::infinity();
    result.stress_mpa.setConstant(std::numeric_limits<double>::quiet_NaN());
    result.tangent_mpa.setConstant(std::numeric_limits<double>::quiet_NaN());
    return result;
  }
  // S = mu (1 - C^-1 / det C), and its derivative with dC^-1 = -C^-1 dC C^-1.
  const double i11 = c22 / det, i22 = c11 / det, i12 = -c12 / det;
  const Vec3 inverse(i11, i22, i12);
  result.energy_mpa = 0.5 * mu * (c11 + c22 + 1 / det - 3);
  result.stress_mpa = mu * (Vec3(1, 1, 0) - inverse / det);
  Mat3 product;                                // of C^-1 with itself, symmetrised
  product << i11 * i11, i12 * i12, i11 * i12,  //
      i12 * i12, i22 * i22, i22 * i12,         //
      i11 * i12, i22 * i12, 0.5 * (i11 * i22 + i12 * i12);
  result.tangent_mpa = (2 * mu / det) * (inverse * inverse.transpose() + product);
  return result;
}

}  // namespace

PlaneStress PlaneStressOf(const Material& material, const Vec3& strain) {
  return material.law == MaterialLaw::kNeoHookean ? NeoHookean(material, strain)
                                                  : SaintVenantKirchhoff(material, strain);
}

double TransverseShearModulus(const Material& material) {
  return kShearCorrection * material.youngs_modulus_mpa / (2 * (1 + material.poisson_ratio));
}

}  // namespace taclink
