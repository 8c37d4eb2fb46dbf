#include "sensing/shell/plane_stress.h"

#include <limits>

namespace taclink {
namespace {

constexpr double kShearCorrection = 5.0 / 6.0;
constexpr double kFoundation = 16;  // see mitc4.md

void SaintVenantKirchhoff(const Material& material, const Lanes3& strain, PlaneStress& answer) {
  const double nu = material.poisson_ratio;
  const double c = material.youngs_modulus_mpa / (1 - nu * nu), g = c * (1 - nu) / 2;
  const auto& [e11, e22, e12] = strain;
  answer.stress_mpa = {c * e11 + c * nu * e22, c * nu * e11 + c * e22, g * e12};
  answer.tangent_mpa = {c, c, g, c * nu, 0.0, 0.0};
  const auto& [s11, s22, s12] = answer.stress_mpa;
  answer.energy_mpa = 0.5 * (e11 * s11 + e22 * s22 + e12 * s12);
}

void NeoHookean(const Material& material, const Lanes3& strain, PlaneStress& answer) {
  const double mu = material.youngs_modulus_mpa / 3;
  const Lanes c11 = 1 + 2 * strain[0], c22 = 1 + 2 * strain[1], c12 = strain[2];
  const Lanes det = c11 * c22 - c12 * c12;
  // S = mu (1 - C^-1 / det C), and its derivative with dC^-1 = -C^-1 dC C^-1.
  const Lanes i11 = c22 / det, i22 = c11 / det, i12 = -c12 / det;
  answer.energy_mpa = 0.5 * mu * (c11 + c22 + 1 / det - 3);
  answer.stress_mpa = {mu * (1 - i11 / det), mu * (1 - i22 / det), -mu * i12 / det};
  const Lanes factor = 2 * mu / det;
  answer.tangent_mpa = {
      factor * 2 * i11 * i11,           factor * 2 * i22 * i22, factor * (1.5 * i12 * i12 + 0.5 * i11 * i22),
      factor * (i11 * i22 + i12 * i12), factor * 2 * i11 * i12, factor * 2 * i22 * i12};
  for (size_t point = 0; point < 4; ++point) {
    if (det[point] > 0 && c11[point] > 0) continue;
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    answer.energy_mpa.Set(point, std::numeric_limits<double>::infinity());
    for (Lanes& stress : answer.stress_mpa) stress.Set(point, kNone);
    for (Lanes& tangent : answer.tangent_mpa) tangent.Set(point, kNone);
  }
}

}  // namespace

void PlaneStressOf(const Material& material, const Lanes3& strain, PlaneStress& answer) {
  if (material.law == MaterialLaw::kNeoHookean) {
    NeoHookean(material, strain, answer);
  } else {
    SaintVenantKirchhoff(material, strain, answer);
  }
}

double TransverseShearModulus(const Material& material, double thickness_mm, const ElementSpan& span) {
  const double e = material.youngs_modulus_mpa, nu = material.poisson_ratio;
  const double shear = kShearCorrection * e / (2 * (1 + nu)), slenderness = span.length_mm / thickness_mm;
  const double foundation = slenderness * span.length_mm * span.curvature_across_per_mm;
  const double share = 1 / (1 + kFoundation * 12 * (1 - nu * nu) * foundation * foundation);
  return 1 / (1 / shear + share * slenderness * slenderness * (1 - nu * nu) / e);
}

}  // namespace taclink
