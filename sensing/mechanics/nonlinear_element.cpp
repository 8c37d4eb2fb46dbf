#include "sensing/mechanics/nonlinear_element.h"

#include <Eigen/LU>

#include "sensing/mechanics/plane_stress.h"

namespace taclink {
namespace {

using Shape = Eigen::Vector4d;
using Corners = Eigen::Matrix<double, 3, 4>;
using Wide = Eigen::Matrix<double, 3, 12>;  // in-plane strains by the corners' points at one height

// In-plane Gauss points and the middles of the edges, where transverse shears are tied.
const std::array<ShapeFunctions, 4>& GaussShapes() {
  static const std::array<ShapeFunctions, 4> kShapes = {
      ShapeFunctionsAt(-kGauss, -kGauss), ShapeFunctionsAt(kGauss, -kGauss), ShapeFunctionsAt(kGauss, kGauss),
      ShapeFunctionsAt(-kGauss, kGauss)};
  return kShapes;
}
constexpr std::array<std::array<double, 2>, 4> kGaussAt = {
    {{-kGauss, -kGauss}, {kGauss, -kGauss}, {kGauss, kGauss}, {-kGauss, kGauss}}};

struct Tying {
  ShapeFunctions shape;
  bool along_xi;
};
const std::array<Tying, 4>& TyingPoints() {
  static const std::array<Tying, 4> kPoints = {
      Tying{ShapeFunctionsAt(0, -1), true}, Tying{ShapeFunctionsAt(0, 1), true},
      Tying{ShapeFunctionsAt(-1, 0), false}, Tying{ShapeFunctionsAt(1, 0), false}};
  return kPoints;
}
const Shape& SlopeOf(const Tying& tying) {
  return tying.along_xi ? tying.shape.by_xi : tying.shape.by_eta;
}

Corners Mids(const ElementState& q) {
  Corners c;
  for (Eigen::Index i = 0; i < 4; ++i) c.col(i) = q.segment<3>(6 * i);
  return c;
}
Corners Directors(const ElementState& q) {
  Corners c;
  for (Eigen::Index i = 0; i < 4; ++i) c.col(i) = q.segment<3>(6 * i + 3);
  return c;
}

// Covariant shear g_a . g_3 (g_3 by the unit normalised coordinate zeta) at the tying points.
Eigen::Vector4d TyingShears(const Corners& mids, const Corners& directors, double half_thickness) {
  Eigen::Vector4d shears;
  for (size_t k = 0; k < 4; ++k) {
    const Tying& tying = TyingPoints()[k];
    shears[static_cast<Eigen::Index>(k)] =
        half_thickness * (mids * SlopeOf(tying)).dot(directors * tying.shape.value);
  }
  return shears;
}

}  // namespace

NonlinearElement::NonlinearElement(const ElementState& rest, double thickness_mm, const Material& material)
    : thickness_mm_(thickness_mm), material_(material), shear_modulus_mpa_(TransverseShearModulus(material)) {
  const Corners mids = Mids(rest), directors = Directors(rest);
  const double half = thickness_mm / 2;
  rest_tying_ = TyingShears(mids, directors, half);
  for (size_t p = 0; p < 4; ++p) {
    const ShapeFunctions& n = GaussShapes()[p];
    const auto [xi, eta] = kGaussAt[p];
    for (size_t layer = 0; layer < 2; ++layer) {
      Point& point = points_[p][layer];
      point.height_mm = (layer == 0 ? -kGauss : kGauss) * half;
      const Corners at_height = mids + point.height_mm * directors;
      Mat3 base;
      base << at_height * n.by_xi, at_height * n.by_eta, half * (directors * n.value);
      point.weight_mm3 = base.determinant();
      Mat3 frame;
      frame.col(2) = base.col(0).cross(base.col(1)).normalized();
      frame.col(0) = base.col(0).normalized();
      frame.col(1) = frame.col(2).cross(frame.col(0));
      const Mat3 q = base.inverse() * frame;  // q(a, k) = g^a . e_k
      // eps_kl = e_ab q(a, k) q(b, l) from (e11, e22, 2 e12); engineering shears get the factor 2.
      const auto row = [&](Eigen::Index k, Eigen::Index l, double factor) {
        return Eigen::RowVector3d(factor * q(0, k) * q(0, l), factor * q(1, k) * q(1, l),
                                  0.5 * factor * (q(0, k) * q(1, l) + q(1, k) * q(0, l)));
      };
      point.in_plane << row(0, 0, 1), row(1, 1, 1), row(0, 1, 2);
      point.warp << row(0, 2, 2), row(1, 2, 2);
      const Eigen::RowVector4d xi_shear(0.5 * (1 - eta), 0.5 * (1 + eta), 0, 0);
      const Eigen::RowVector4d eta_shear(0, 0, 0.5 * (1 - xi), 0.5 * (1 + xi));
      for (Eigen::Index k = 0; k < 2; ++k) {
        point.shear.row(k) = (q(0, k) * q(2, 2) + q(2, k) * q(0, 2)) * xi_shear +
                             (q(1, k) * q(2, 2) + q(2, k) * q(1, 2)) * eta_shear;
      }
      const Vec3 g1 = base.col(0), g2 = base.col(1);
      point.rest_metric = {g1.dot(g1), g2.dot(g2), 2 * g1.dot(g2)};
    }
  }
}

struct NonlinearElement::Sums {
  using Block = Eigen::Matrix<double, 12, 12>;
  using Cross = Eigen::Matrix<double, 12, 4>;

  // By the corners' points at a height z: x + z d. Kept apart by powers of z.
  Corners mid_force = Corners::Zero(), director_force = Corners::Zero();
  Eigen::Vector4d tying_force = Eigen::Vector4d::Zero();
  Block mid_mid, mid_director, director_director;  // these and below: only with the Hessian
  Cross mid_tying, director_tying;
  Eigen::Matrix4d tying_stiffness;
};

template <DerivativeOrder kOrder>
void NonlinearElement::AddUpTo(const ElementState& state, ElementResponse& response) const {
  const Corners mids = Mids(state), directors = Directors(state);
  const Eigen::Vector4d tying = TyingShears(mids, directors, thickness_mm_ / 2) - rest_tying_;
  Sums sums;
  if constexpr (kOrder == DerivativeOrder::kHessian) {
    for (auto* block : {&sums.mid_mid, &sums.mid_director, &sums.director_director}) block->setZero();
    for (auto* cross : {&sums.mid_tying, &sums.director_tying}) cross->setZero();
    sums.tying_stiffness.setZero();
  }
  for (size_t p = 0; p < 4; ++p) {
    const ShapeFunctions& n = GaussShapes()[p];
    const Vec3 a1 = mids * n.by_xi, a2 = mids * n.by_eta;
    const Vec3 b1 = directors * n.by_xi, b2 = directors * n.by_eta;
    for (const Point& point : points_[p]) {
      const double z = point.height_mm, w = point.weight_mm3;
      const Vec3 g1 = a1 + z * b1, g2 = a2 + z * b2;
      const Vec3 covariant = 0.5 * (Vec3(g1.dot(g1), g2.dot(g2), 2 * g1.dot(g2)) - point.rest_metric);
      const PlaneStress sheet = PlaneStressOf(material_, point.in_plane * covariant);
      const Vec2 shear = point.warp * covariant + point.shear * tying;
      response.energy_nmm += w * (sheet.energy_mpa + 0.5 * shear_modulus_mpa_ * shear.squaredNorm());
      if constexpr (kOrder != DerivativeOrder::kEnergy) {
        const Vec2 shear_stress = w * shear_modulus_mpa_ * shear;
        const Vec3 s =
            w * point.in_plane.transpose() * sheet.stress_mpa + point.warp.transpose() * shear_stress;
        sums.tying_force += point.shear.transpose() * shear_stress;
        const Corners force =
            (s[0] * g1 + s[2] * g2) * n.by_xi.transpose() + (s[1] * g2 + s[2] * g1) * n.by_eta.transpose();
        sums.mid_force += force;
        sums.director_force += z * force;
        if constexpr (kOrder == DerivativeOrder::kHessian) {
          AddStiffness(point, n, g1, g2, s, sheet.tangent_mpa, sums);
        }
      }
    }
  }
  if constexpr (kOrder == DerivativeOrder::kEnergy) return;

  const Tied by_state = TyingByState(mids, directors);
  for (Eigen::Index i = 0; i < 4; ++i) {
    response.gradient.segment<3>(6 * i) += sums.mid_force.col(i);
    response.gradient.segment<3>(6 * i + 3) += sums.director_force.col(i);
  }
  response.gradient.noalias() += by_state.transpose() * sums.tying_force;
  if constexpr (kOrder == DerivativeOrder::kHessian) AddHessian(sums, by_state, response.hessian);
}

// Of one point of integration: material, then geometric.
void NonlinearElement::AddStiffness(const Point& point, const ShapeFunctions& n, const Vec3& g1,
                                    const Vec3& g2, const Vec3& s, const Mat3& tangent_mpa,
                                    Sums& sums) const {
  const double z = point.height_mm, w = point.weight_mm3, g = w * shear_modulus_mpa_;
  Wide b;
  for (Eigen::Index i = 0; i < 4; ++i) {
    b.block<1, 3>(0, 3 * i) = n.by_xi[i] * g1.transpose();
    b.block<1, 3>(1, 3 * i) = n.by_eta[i] * g2.transpose();
    b.block<1, 3>(2, 3 * i) = n.by_eta[i] * g1.transpose() + n.by_xi[i] * g2.transpose();
  }
  const Mat3 c =
      w * point.in_plane.transpose() * tangent_mpa * point.in_plane + g * point.warp.transpose() * point.warp;
  Sums::Block k;
  k.noalias() = b.transpose() * (c * b);
  const Eigen::Matrix4d geometric = s[0] * n.by_xi * n.by_xi.transpose() +
                                    s[1] * n.by_eta * n.by_eta.transpose() +
                                    s[2] * (n.by_xi * n.by_eta.transpose() + n.by_eta * n.by_xi.transpose());
  for (Eigen::Index i = 0; i < 4; ++i) {
    for (Eigen::Index j = 0; j < 4; ++j) {
      for (Eigen::Index a = 0; a < 3; ++a) k(3 * i + a, 3 * j + a) += geometric(i, j);
    }
  }
  sums.mid_mid += k;
  sums.mid_director += z * k;
  sums.director_director += z * z * k;
  const Sums::Cross cross = b.transpose() * (g * point.warp.transpose() * point.shear);
  sums.mid_tying += cross;
  sums.director_tying += z * cross;
  sums.tying_stiffness += g * point.shear.transpose() * point.shear;
}

// The tying shears are bilinear in points and directors.
NonlinearElement::Tied NonlinearElement::TyingByState(const Corners& mids, const Corners& directors) const {
  const double half = thickness_mm_ / 2;
  Tied by_state;
  for (size_t t = 0; t < 4; ++t) {
    const Tying& tie = TyingPoints()[t];
    const auto row = static_cast<Eigen::Index>(t);
    const Vec3 along = half * (mids * SlopeOf(tie)), across = half * (directors * tie.shape.value);
    for (Eigen::Index i = 0; i < 4; ++i) {
      by_state.block<1, 3>(row, 6 * i) = SlopeOf(tie)[i] * across.transpose();
      by_state.block<1, 3>(row, 6 * i + 3) = tie.shape.value[i] * along.transpose();
    }
  }
  return by_state;
}

void NonlinearElement::AddHessian(const Sums& sums, const Tied& by_state, ElementHessian& hessian) const {
  Eigen::Matrix<double, 24, 4> cross;
  for (Eigen::Index i = 0; i < 4; ++i) {
    for (Eigen::Index j = 0; j < 4; ++j) {
      hessian.block<3, 3>(6 * i, 6 * j) += sums.mid_mid.block<3, 3>(3 * i, 3 * j);
      hessian.block<3, 3>(6 * i, 6 * j + 3) += sums.mid_director.block<3, 3>(3 * i, 3 * j);
      hessian.block<3, 3>(6 * i + 3, 6 * j) += sums.mid_director.block<3, 3>(3 * i, 3 * j);
      hessian.block<3, 3>(6 * i + 3, 6 * j + 3) += sums.director_director.block<3, 3>(3 * i, 3 * j);
    }
    cross.middleRows<3>(6 * i) = sums.mid_tying.middleRows<3>(3 * i);
    cross.middleRows<3>(6 * i + 3) = sums.director_tying.middleRows<3>(3 * i);
  }
  const ElementHessian mixed = cross * by_state;
  hessian += mixed + mixed.transpose();
  hessian.noalias() += by_state.transpose() * (sums.tying_stiffness * by_state);
  for (size_t t = 0; t < 4; ++t) {
    const Tying& tie = TyingPoints()[t];
    const double force = thickness_mm_ / 2 * sums.tying_force[static_cast<Eigen::Index>(t)];
    for (Eigen::Index i = 0; i < 4; ++i) {
      for (Eigen::Index j = 0; j < 4; ++j) {
        const double entry = force * SlopeOf(tie)[i] * tie.shape.value[j];
        for (Eigen::Index a = 0; a < 3; ++a) {
          hessian(6 * i + a, 6 * j + 3 + a) += entry;
          hessian(6 * j + 3 + a, 6 * i + a) += entry;
        }
      }
    }
  }
}

void NonlinearElement::Add(DerivativeOrder order, const ElementState& state,
                           ElementResponse& response) const {
  switch (order) {
    case DerivativeOrder::kEnergy:
      return AddUpTo<DerivativeOrder::kEnergy>(state, response);
    case DerivativeOrder::kGradient:
      return AddUpTo<DerivativeOrder::kGradient>(state, response);
    case DerivativeOrder::kHessian:
      return AddUpTo<DerivativeOrder::kHessian>(state, response);
  }
}

}  // namespace taclink
