#include "sensing/shell/nonlinear_element.h"

#include <Eigen/LU>

#include "sensing/shell/plane_stress.h"

namespace taclink {
namespace {

using Shape = Eigen::Vector4d;
using CornerVectors = Eigen::Matrix<double, 3, 4>;
// Products here are lazyProduct: Eigen would pack matrices of this size as if they were large.

// Slopes of the corners' shape functions at the Gauss points, and their products.
struct Slopes {
  static constexpr int kPairs = 10;  // of corners i <= j

  Slopes() {
    const auto& [value, by_xi, by_eta] = ShapesAtGaussPoints();
    for (size_t i = 0, pair = 0; i < 4; ++i) {
      const auto corner = static_cast<Eigen::Index>(i);
      for (Eigen::Index p = 0; p < 4; ++p) {
        corners(corner, p) = by_xi[i][static_cast<size_t>(p)];
        corners(corner, 4 + p) = by_eta[i][static_cast<size_t>(p)];
      }
      for (size_t j = i; j < 4; ++j, ++pair) {
        const Lanes products[] = {by_xi[i] * by_xi[j], by_xi[i] * by_eta[j], by_eta[i] * by_xi[j],
                                  by_eta[i] * by_eta[j]};
        for (Eigen::Index k = 0; k < 16; ++k)
          pairs(static_cast<Eigen::Index>(pair), k) = products[k / 4][static_cast<size_t>(k % 4)];
      }
    }
  }

  Eigen::Matrix<double, 4, 8> corners;      // by xi at each point, by eta at each point
  Eigen::Matrix<double, kPairs, 16> pairs;  // xi xi, xi eta, eta xi, eta eta, each at each point
};
const Slopes& GaussSlopes() {
  static const Slopes kSlopes;
  return kSlopes;
}

// The middles of the edges, where transverse shears are tied: two along xi, two along eta.
struct Edge {
  Eigen::Index from, to;  // corners
};
constexpr std::array<Edge, 4> kEdges = {{{0, 1}, {3, 2}, {0, 3}, {1, 2}}};

CornerVectors Mids(const ElementState& q) {
  CornerVectors c;
  for (Eigen::Index i = 0; i < 4; ++i) c.col(i) = q.segment<3>(6 * i);
  return c;
}
CornerVectors Directors(const ElementState& q) {
  CornerVectors c;
  for (Eigen::Index i = 0; i < 4; ++i) c.col(i) = q.segment<3>(6 * i + 3);
  return c;
}

// Covariant shear g_a . g_3 (g_3 by the unit normalised coordinate zeta) at the tying points.
Eigen::Vector4d ShearsAtTyingPoints(const CornerVectors& mids, const CornerVectors& directors,
                                    double half_thickness) {
  Eigen::Vector4d shears;
  for (size_t t = 0; t < 4; ++t) {
    const auto [from, to] = kEdges[t];
    shears[static_cast<Eigen::Index>(t)] =
        0.25 * half_thickness * (mids.col(to) - mids.col(from)).dot(directors.col(to) + directors.col(from));
  }
  return shears;
}

// Along xi and eta, through the middle.
std::array<ElementSpan, 2> Spans(const CornerVectors& mids, const CornerVectors& directors) {
  const auto by_xi = [](const CornerVectors& c) {
    return (c.col(1) + c.col(2) - c.col(0) - c.col(3)).norm() / 2;
  };
  const auto by_eta = [](const CornerVectors& c) {
    return (c.col(2) + c.col(3) - c.col(0) - c.col(1)).norm() / 2;
  };
  const double xi_mm = by_xi(mids), eta_mm = by_eta(mids);
  return {ElementSpan{xi_mm, by_eta(directors) / eta_mm}, ElementSpan{eta_mm, by_xi(directors) / xi_mm}};
}

}  // namespace

NonlinearElement::NonlinearElement(const ElementState& rest, double thickness_mm, const Material& material)
    : thickness_mm_(thickness_mm), material_(material) {
  const CornerVectors mids = Mids(rest), directors = Directors(rest);
  const auto [along, across] = Spans(mids, directors);
  shear_moduli_mpa_ = {TransverseShearModulus(material, thickness_mm, along),
                       TransverseShearModulus(material, thickness_mm, across)};
  rest_tying_ = ShearsAtTyingPoints(mids, directors, thickness_mm / 2);
  for (size_t side = 0; side < 2; ++side) {
    layers_[side].height_mm = (side == 0 ? -kGauss : kGauss) * thickness_mm / 2;
    for (size_t p = 0; p < 4; ++p) SetPoint(mids, directors, p, layers_[side]);
  }
}

void NonlinearElement::SetPoint(const CornerVectors& mids, const CornerVectors& directors, size_t p,
                                Layer& layer) {
  const auto [xi, eta] = kGaussPoints[p];
  const ShapeFunctions n = ShapeFunctionsAt(xi, eta);
  const CornerVectors at_height = mids + layer.height_mm * directors;
  Mat3 base;
  base << at_height * n.by_xi, at_height * n.by_eta, thickness_mm_ / 2 * (directors * n.value);
  const Vec3 g1 = base.col(0), g2 = base.col(1);
  const double weight = base.determinant();
  Mat3 frame;
  frame.col(2) = g1.cross(g2).normalized();
  frame.col(0) = g1.normalized();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  const Mat3 q = base.inverse() * frame;  // q(a, k) = g^a . e_k
  // eps_kl = e_ab q(a, k) q(b, l) from (e11, e22, 2 e12); engineering shears get the factor 2.
  const auto set_row = [&](Eigen::Index k, Eigen::Index l, double factor, Lanes3& row) {
    row[0].Set(p, factor * q(0, k) * q(0, l));
    row[1].Set(p, factor * q(1, k) * q(1, l));
    row[2].Set(p, 0.5 * factor * (q(0, k) * q(1, l) + q(1, k) * q(0, l)));
  };
  set_row(0, 0, 1, layer.in_plane[0]);
  set_row(1, 1, 1, layer.in_plane[1]);
  set_row(0, 1, 2, layer.in_plane[2]);
  Eigen::Matrix<double, 2, 4> shear;
  const Eigen::RowVector4d xi_shear(0.5 * (1 - eta), 0.5 * (1 + eta), 0, 0);
  const Eigen::RowVector4d eta_shear(0, 0, 0.5 * (1 - xi), 0.5 * (1 + xi));
  for (Eigen::Index k = 0; k < 2; ++k) {
    const auto row = static_cast<size_t>(k);
    set_row(k, 2, 2, layer.warp[row]);
    shear.row(k) = (q(0, k) * q(2, 2) + q(2, k) * q(0, 2)) * xi_shear +
                   (q(1, k) * q(2, 2) + q(2, k) * q(1, 2)) * eta_shear;
    for (size_t t = 0; t < 4; ++t) layer.shear[row][t].Set(p, shear(k, static_cast<Eigen::Index>(t)));
  }
  for (Eigen::Index k = 0; k < 2; ++k)
    tying_stiffness_ +=
        weight * shear_moduli_mpa_[static_cast<size_t>(k)] * shear.row(k).transpose() * shear.row(k);
  layer.weight_mm3.Set(p, weight);
  layer.rest_metric[0].Set(p, g1.dot(g1));
  layer.rest_metric[1].Set(p, g2.dot(g2));
  layer.rest_metric[2].Set(p, 2 * g1.dot(g2));
}

// The points of a layer in a state.
struct NonlinearElement::Strained {
  Lanes3 g1, g2;  // covariant base
  PlaneStress sheet;
  std::array<Lanes, 2> shear, shear_force;  // the latter and the next: times the weight
  Lanes3 force;                             // by the covariant strains e11, e22, 2 e12
};

void NonlinearElement::Strain(const Layer& layer, const CornerVectors& at_height,
                              const Eigen::Vector4d& tying, Strained& strained) const {
  auto& [g1, g2, sheet, shear, shear_force, force] = strained;
  g1 = Interpolate(at_height, ShapesAtGaussPoints().by_xi);
  g2 = Interpolate(at_height, ShapesAtGaussPoints().by_eta);
  const Lanes3 covariant = {0.5 * (Dot(g1, g1) - layer.rest_metric[0]),
                            0.5 * (Dot(g2, g2) - layer.rest_metric[1]),
                            Dot(g1, g2) - 0.5 * layer.rest_metric[2]};
  const Lanes3 strain = {Dot(layer.in_plane[0], covariant), Dot(layer.in_plane[1], covariant),
                         Dot(layer.in_plane[2], covariant)};
  PlaneStressOf(material_, strain, sheet);
  for (size_t r = 0; r < 2; ++r) {
    const auto& by_tying = layer.shear[r];
    shear[r] = Dot(layer.warp[r], covariant) + by_tying[0] * tying[0] + by_tying[1] * tying[1] +
               by_tying[2] * tying[2] + by_tying[3] * tying[3];
    shear_force[r] = shear_moduli_mpa_[r] * layer.weight_mm3 * shear[r];
  }
  for (size_t l = 0; l < 3; ++l) {
    force[l] = layer.weight_mm3 *
                   (layer.in_plane[0][l] * sheet.stress_mpa[0] + layer.in_plane[1][l] * sheet.stress_mpa[1] +
                    layer.in_plane[2][l] * sheet.stress_mpa[2]) +
               layer.warp[0][l] * shear_force[0] + layer.warp[1][l] * shear_force[1];
  }
}

// By the corners' points x + z d: with z to the power of nought (mid-surface) and one (director).
struct NonlinearElement::Sums {
  using Forces = Eigen::Matrix<double, 8, 3>;      // along xi and eta at each point
  using Stiffness = Eigen::Matrix<double, 16, 9>;  // of pairs of them
  using Mixed = Eigen::Matrix<double, 8, 12>;      // of one of them and a tying shear

  std::array<Forces, 2> forces = {Forces::Zero(), Forces::Zero()};
  Eigen::Vector4d tying_force = Eigen::Vector4d::Zero();
  std::array<Stiffness, 2> stiffness;  // this and the next: only with the Hessian
  std::array<Mixed, 2> mixed;
};

template <DerivativeOrder kOrder>
void NonlinearElement::AddUpTo(const ElementState& state, ElementResponse& response) const {
  const CornerVectors mids = Mids(state), directors = Directors(state);
  const Eigen::Vector4d tying = ShearsAtTyingPoints(mids, directors, thickness_mm_ / 2) - rest_tying_;
  Sums sums;
  if constexpr (kOrder == DerivativeOrder::kHessian) {
    for (auto& stiffness : sums.stiffness) stiffness.setZero();
    for (auto& mixed : sums.mixed) mixed.setZero();
  }
  for (const Layer& layer : layers_) {
    Strained strained;
    Strain(layer, mids + layer.height_mm * directors, tying, strained);
    const auto& [g1, g2, sheet, shear, shear_force, force] = strained;
    response.energy_nmm += Sum(layer.weight_mm3 * sheet.energy_mpa +
                               0.5 * (shear[0] * shear_force[0] + shear[1] * shear_force[1]));
    if constexpr (kOrder == DerivativeOrder::kEnergy) continue;
    for (size_t t = 0; t < 4; ++t) {
      sums.tying_force[static_cast<Eigen::Index>(t)] +=
          Sum(layer.shear[0][t] * shear_force[0] + layer.shear[1][t] * shear_force[1]);
    }
    Sums::Forces forces;
    for (size_t a = 0; a < 3; ++a) {
      (force[0] * g1[a] + force[2] * g2[a]).Write(&forces(0, static_cast<Eigen::Index>(a)));
      (force[1] * g2[a] + force[2] * g1[a]).Write(&forces(4, static_cast<Eigen::Index>(a)));
    }
    sums.forces[0] += forces;
    sums.forces[1] += layer.height_mm * forces;
    if constexpr (kOrder == DerivativeOrder::kHessian) AddStiffness(layer, strained, sums);
  }
  if constexpr (kOrder == DerivativeOrder::kEnergy) return;

  const Tied by_state = TyingByState(mids, directors);
  for (size_t power = 0; power < 2; ++power) {
    const Eigen::Matrix<double, 4, 3> at_corners = GaussSlopes().corners.lazyProduct(sums.forces[power]);
    for (Eigen::Index i = 0; i < 4; ++i) {
      response.gradient.segment<3>(6 * i + 3 * static_cast<Eigen::Index>(power)) +=
          at_corners.row(i).transpose();
    }
  }
  response.gradient += by_state.lazyProduct(sums.tying_force);
  if constexpr (kOrder == DerivativeOrder::kHessian) AddHessian(sums, by_state, response.hessian);
}

// Material, and geometric on the diagonals.
void NonlinearElement::AddStiffness(const Layer& layer, const Strained& strained, Sums& sums) const {
  const Lanes3 &g1 = strained.g1, &g2 = strained.g2, &s = strained.force;
  const std::array<Lanes, 2> weighted = {shear_moduli_mpa_[0] * layer.weight_mm3,
                                         shear_moduli_mpa_[1] * layer.weight_mm3};
  const auto& p = layer.in_plane;
  const auto& [t11, t22, t33, t12, t13, t23] = strained.sheet.tangent_mpa;
  // By the covariant strains.
  std::array<Lanes3, 3> c;
  for (size_t l = 0; l < 3; ++l) {
    const Lanes3 by_strain = {t11 * p[0][l] + t12 * p[1][l] + t13 * p[2][l],
                              t12 * p[0][l] + t22 * p[1][l] + t23 * p[2][l],
                              t13 * p[0][l] + t23 * p[1][l] + t33 * p[2][l]};
    for (size_t k = 0; k <= l; ++k) {
      c[k][l] =
          layer.weight_mm3 * (p[0][k] * by_strain[0] + p[1][k] * by_strain[1] + p[2][k] * by_strain[2]) +
          weighted[0] * layer.warp[0][k] * layer.warp[0][l] +
          weighted[1] * layer.warp[1][k] * layer.warp[1][l];
    }
  }
  Sums::Stiffness stiffness;
  for (size_t a = 0; a < 3; ++a) {
    for (size_t b = 0; b < 3; ++b) {
      const Lanes g11 = g1[a] * g1[b], g12 = g1[a] * g2[b], g21 = g2[a] * g1[b], g22 = g2[a] * g2[b];
      Lanes xi_xi = c[0][0] * g11 + c[0][2] * (g12 + g21) + c[2][2] * g22;
      Lanes xi_eta = c[0][2] * g11 + c[0][1] * g12 + c[2][2] * g21 + c[1][2] * g22;
      Lanes eta_xi = c[0][2] * g11 + c[0][1] * g21 + c[2][2] * g12 + c[1][2] * g22;
      Lanes eta_eta = c[2][2] * g11 + c[1][2] * (g12 + g21) + c[1][1] * g22;
      if (a == b) {
        xi_xi += s[0];
        xi_eta += s[2];
        eta_xi += s[2];
        eta_eta += s[1];
      }
      double* column = &stiffness(0, static_cast<Eigen::Index>(3 * a + b));
      xi_xi.Write(column);
      xi_eta.Write(column + 4);
      eta_xi.Write(column + 8);
      eta_eta.Write(column + 12);
    }
  }
  Sums::Mixed mixed;
  for (size_t t = 0; t < 4; ++t) {
    Lanes3 w;
    for (size_t l = 0; l < 3; ++l)
      w[l] = weighted[0] * layer.warp[0][l] * layer.shear[0][t] +
             weighted[1] * layer.warp[1][l] * layer.shear[1][t];
    for (size_t a = 0; a < 3; ++a) {
      double* column = &mixed(0, static_cast<Eigen::Index>(3 * t + a));
      (w[0] * g1[a] + w[2] * g2[a]).Write(column);
      (w[1] * g2[a] + w[2] * g1[a]).Write(column + 4);
    }
  }
  sums.stiffness[0] += stiffness;
  sums.stiffness[1] += layer.height_mm * stiffness;
  sums.mixed[0] += mixed;
  sums.mixed[1] += layer.height_mm * mixed;
}

// The tying shears are bilinear in points and directors.
NonlinearElement::Tied NonlinearElement::TyingByState(const CornerVectors& mids,
                                                      const CornerVectors& directors) const {
  Tied by_state = Tied::Zero();
  for (size_t t = 0; t < 4; ++t) {
    const auto [from, to] = kEdges[t];
    const auto column = static_cast<Eigen::Index>(t);
    const Vec3 by_mid = thickness_mm_ / 8 * (directors.col(to) + directors.col(from));
    const Vec3 by_director = thickness_mm_ / 8 * (mids.col(to) - mids.col(from));
    by_state.block<3, 1>(6 * from, column) = -by_mid;
    by_state.block<3, 1>(6 * to, column) = by_mid;
    by_state.block<3, 1>(6 * from + 3, column) = by_director;
    by_state.block<3, 1>(6 * to + 3, column) = by_director;
  }
  return by_state;
}

void NonlinearElement::AddHessian(const Sums& sums, const Tied& by_state, ElementHessian& hessian) const {
  const Slopes& slopes = GaussSlopes();
  using Pairs = Eigen::Matrix<double, Slopes::kPairs, 9>;
  const Pairs mids = slopes.pairs.lazyProduct(sums.stiffness[0]);
  const Pairs mid_director = slopes.pairs.lazyProduct(sums.stiffness[1]);
  const Pairs directors = layers_[0].height_mm * layers_[0].height_mm * mids;
  for (Eigen::Index i = 0, pair = 0; i < 4; ++i) {
    for (Eigen::Index j = i; j < 4; ++j, ++pair) {
      for (Eigen::Index a = 0; a < 3; ++a) {
        for (Eigen::Index b = 0; b < 3; ++b) {
          const Eigen::Index k = 3 * a + b, row = 6 * i + a, column = 6 * j + b;
          hessian(row, column) += mids(pair, k);
          hessian(row, column + 3) += mid_director(pair, k);
          hessian(row + 3, column) += mid_director(pair, k);
          hessian(row + 3, column + 3) += directors(pair, k);
          if (i == j) continue;
          hessian(column, row) += mids(pair, k);
          hessian(column + 3, row) += mid_director(pair, k);
          hessian(column, row + 3) += mid_director(pair, k);
          hessian(column + 3, row + 3) += directors(pair, k);
        }
      }
    }
  }
  AddTying(sums, by_state, hessian);
}

void NonlinearElement::AddTying(const Sums& sums, const Tied& by_state, ElementHessian& hessian) const {
  Tied cross = 0.5 * by_state.lazyProduct(tying_stiffness_);
  for (size_t power = 0; power < 2; ++power) {
    const Eigen::Matrix<double, 4, 12> at_corners = GaussSlopes().corners.lazyProduct(sums.mixed[power]);
    for (Eigen::Index i = 0; i < 4; ++i) {
      for (Eigen::Index t = 0; t < 4; ++t) {
        cross.block<3, 1>(6 * i + 3 * static_cast<Eigen::Index>(power), t) +=
            at_corners.block<1, 3>(i, 3 * t).transpose();
      }
    }
  }
  ElementHessian mixed = ElementHessian::Zero();
  for (size_t k = 0; k < 4; ++k) {
    const auto t = static_cast<Eigen::Index>(k);
    for (const Eigen::Index corner : {kEdges[k].from, kEdges[k].to}) {
      for (Eigen::Index c = 6 * corner; c < 6 * corner + 6; ++c)
        mixed.col(c) += by_state(c, t) * cross.col(t);
    }
    // A shear's own second derivative: by one corner's point and the other's director.
    const double force = thickness_mm_ / 8 * sums.tying_force[t];
    for (const Eigen::Index corner : {kEdges[k].from, kEdges[k].to}) {
      for (Eigen::Index a = 0; a < 3; ++a) {
        mixed(6 * kEdges[k].to + a, 6 * corner + 3 + a) += force;
        mixed(6 * kEdges[k].from + a, 6 * corner + 3 + a) -= force;
      }
    }
  }
  hessian += mixed + mixed.transpose();
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
