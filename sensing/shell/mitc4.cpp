#include "sensing/shell/mitc4.h"

#include <Eigen/LU>
#include <cmath>

#include "sensing/shell/plane_stress.h"
#include "sensing/shell/shape_functions.h"

namespace taclink {
namespace {

using StrainRow = Eigen::Matrix<double, 1, kElementDofs>;
using StrainMatrix = Eigen::Matrix<double, 5, kElementDofs>;
using Corners = std::array<ShellCorner, 4>;

constexpr std::array<double, 4> kXi = {-1, 1, 1, -1};
constexpr std::array<double, 4> kEta = {-1, -1, 1, 1};

// Base vectors of the solid at a point, and the derivatives of its displacement by the element's degrees of
// freedom.
struct PointKinematics {
  std::array<Vec3, 3> base;                                      // g_xi, g_eta, g_zeta
  std::array<Eigen::Matrix<double, 3, kElementDofs>, 3> by_dof;  // u_xi, u_eta, u_zeta
};

PointKinematics KinematicsAt(const Corners& corners, double thickness, double xi, double eta, double zeta) {
  PointKinematics k;
  for (auto& g : k.base) g.setZero();
  for (auto& d : k.by_dof) d.setZero();
  for (size_t i = 0; i < 4; ++i) {
    const double n = 0.25 * (1 + kXi[i] * xi) * (1 + kEta[i] * eta);
    const double n_xi = 0.25 * kXi[i] * (1 + kEta[i] * eta);
    const double n_eta = 0.25 * kEta[i] * (1 + kXi[i] * xi);
    const Vec3 half = 0.5 * thickness * corners[i].director;
    const Vec3 p = corners[i].mid_mm + zeta * half;
    k.base[0] += n_xi * p;
    k.base[1] += n_eta * p;
    k.base[2] += n * half;
    const auto at = static_cast<Eigen::Index>(i) * kDofsPerNode;
    const std::array<double, 3> translation = {n_xi, n_eta, 0};
    const std::array<double, 3> rotation = {n_xi * zeta, n_eta * zeta, n};
    for (size_t a = 0; a < 3; ++a) {
      k.by_dof[a].block<3, 3>(0, at).diagonal().setConstant(translation[a]);
      for (Eigen::Index t = 0; t < 2; ++t) {
        k.by_dof[a].col(at + 3 + t) = rotation[a] * corners[i].tangents[static_cast<size_t>(t)].cross(half);
      }
    }
  }
  return k;
}

// Covariant strain 2 e_ab (a = b: e_aa) by the degrees of freedom.
StrainRow CovariantStrain(const PointKinematics& k, size_t a, size_t b) {
  if (a == b) return k.base[a].transpose() * k.by_dof[a];
  return k.base[a].transpose() * k.by_dof[b] + k.base[b].transpose() * k.by_dof[a];
}

// Transverse shears at the middle of the four edges: what the assumed field interpolates.
struct TyingShears {
  StrainRow xi_at_low_eta, xi_at_high_eta, eta_at_low_xi, eta_at_high_xi;
};

TyingShears TyingShearsOf(const Corners& corners, double thickness) {
  return {CovariantStrain(KinematicsAt(corners, thickness, 0, -1, 0), 0, 2),
          CovariantStrain(KinematicsAt(corners, thickness, 0, 1, 0), 0, 2),
          CovariantStrain(KinematicsAt(corners, thickness, -1, 0, 0), 1, 2),
          CovariantStrain(KinematicsAt(corners, thickness, 1, 0, 0), 1, 2)};
}

// Strains (e11, e22, g12, g13, g23) in a Cartesian frame whose third axis is normal to the lamina.
StrainMatrix CartesianStrains(const PointKinematics& k, const StrainRow& shear_xi, const StrainRow& shear_eta,
                              const Mat3& contravariant) {
  Mat3 frame;
  frame.col(2) = k.base[0].cross(k.base[1]).normalized();
  frame.col(0) = k.base[0].normalized();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  const Mat3 q = contravariant.transpose() * frame;  // q(a, k) = g^a . e_k
  const std::array<StrainRow, 5> covariant = {CovariantStrain(k, 0, 0), CovariantStrain(k, 1, 1),
                                              CovariantStrain(k, 0, 1), shear_xi, shear_eta};
  constexpr std::array<std::array<Eigen::Index, 2>, 5> kPairs = {{{0, 0}, {1, 1}, {0, 1}, {0, 2}, {1, 2}}};
  StrainMatrix strains = StrainMatrix::Zero();
  for (size_t row = 0; row < 5; ++row) {
    const auto [m, n] = kPairs[row];
    const double engineering = m == n ? 1 : 2;
    for (size_t term = 0; term < 5; ++term) {
      const auto [a, b] = kPairs[term];
      // `covariant` holds e_aa, or 2 e_ab for a != b, which stands for both e_ab and e_ba.
      const double factor = a == b ? q(a, m) * q(a, n) : 0.5 * (q(a, m) * q(b, n) + q(b, m) * q(a, n));
      strains.row(static_cast<Eigen::Index>(row)) += engineering * factor * covariant[term];
    }
  }
  return strains;
}

// The frame's first axis is along xi.
Eigen::Matrix<double, 5, 5> Elasticity(const std::array<ShellCorner, 4>& corners, double thickness_mm,
                                       const Material& material) {
  const double e = material.youngs_modulus_mpa, nu = material.poisson_ratio;
  const double membrane = e / (1 - nu * nu), shear = e / (2 * (1 + nu));
  Eigen::Matrix<double, 5, 5> c = Eigen::Matrix<double, 5, 5>::Zero();
  c(0, 0) = c(1, 1) = membrane;
  c(0, 1) = c(1, 0) = nu * membrane;
  c(2, 2) = shear;
  // Between the middles of two edges.
  const auto between = [&](Vec3 ShellCorner::* what, std::array<size_t, 2> from, std::array<size_t, 2> to) {
    return (corners[to[0]].*what + corners[to[1]].*what - corners[from[0]].*what - corners[from[1]].*what)
               .norm() /
           2;
  };
  const auto by_xi = [&](Vec3 ShellCorner::* what) { return between(what, {0, 3}, {1, 2}); };
  const auto by_eta = [&](Vec3 ShellCorner::* what) { return between(what, {0, 1}, {2, 3}); };
  const double xi_mm = by_xi(&ShellCorner::mid_mm), eta_mm = by_eta(&ShellCorner::mid_mm);
  c(3, 3) = TransverseShearModulus(material, thickness_mm, {xi_mm, by_eta(&ShellCorner::director) / eta_mm});
  c(4, 4) = TransverseShearModulus(material, thickness_mm, {eta_mm, by_xi(&ShellCorner::director) / xi_mm});
  return c;
}

}  // namespace

std::array<Vec3, 2> TangentsOf(const Vec3& director) {
  const Vec3 helper = std::abs(director.z()) < 0.9 ? Vec3(Vec3::UnitZ()) : Vec3(Vec3::UnitX());
  const Vec3 first = helper.cross(director).normalized();
  return {first, director.cross(first)};
}

ElementMatrix Mitc4Stiffness(const std::array<ShellCorner, 4>& corners, double thickness_mm,
                             const Material& material) {
  const TyingShears tying = TyingShearsOf(corners, thickness_mm);
  const auto elasticity = Elasticity(corners, thickness_mm, material);
  ElementMatrix stiffness = ElementMatrix::Zero();
  for (const double xi : {-kGauss, kGauss}) {
    for (const double eta : {-kGauss, kGauss}) {
      const StrainRow shear_xi =
          0.5 * (1 - eta) * tying.xi_at_low_eta + 0.5 * (1 + eta) * tying.xi_at_high_eta;
      const StrainRow shear_eta =
          0.5 * (1 - xi) * tying.eta_at_low_xi + 0.5 * (1 + xi) * tying.eta_at_high_xi;
      for (const double zeta : {-kGauss, kGauss}) {
        const PointKinematics k = KinematicsAt(corners, thickness_mm, xi, eta, zeta);
        Mat3 covariant;
        covariant << k.base[0], k.base[1], k.base[2];
        const Mat3 contravariant = covariant.inverse().transpose();
        const StrainMatrix b = CartesianStrains(k, shear_xi, shear_eta, contravariant);
        stiffness += covariant.determinant() * b.transpose() * elasticity * b;
      }
    }
  }
  return stiffness;
}

ElementVector PressureLoad(const std::array<ShellCorner, 4>& corners) {
  ElementVector load = ElementVector::Zero();
  for (const double xi : {-kGauss, kGauss}) {
    for (const double eta : {-kGauss, kGauss}) {
      const PointKinematics k = KinematicsAt(corners, 0, xi, eta, 0);
      const Vec3 outward_area = k.base[0].cross(k.base[1]);
      for (size_t i = 0; i < 4; ++i) {
        const double n = 0.25 * (1 + kXi[i] * xi) * (1 + kEta[i] * eta);
        load.segment<3>(static_cast<Eigen::Index>(i) * kDofsPerNode) += n * outward_area;
      }
    }
  }
  return load;
}

}  // namespace taclink
