#include "sensing/shell/ring_forces.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>

#include "sensing/shell/instructions.h"
#include "sensing/shell/shape_functions.h"

namespace taclink {
namespace {

// Weights of the nearer and the farther edge at a Gauss line, times the slope of a linear shape function.
constexpr double kNear = 0.25 * (1 + kGauss), kFar = 0.25 * (1 - kGauss);
// Gauss points as in kGaussPoints: on the line of low or high eta, and of low or high xi.
constexpr std::array<size_t, 4> kEtaLine = {0, 0, 1, 1}, kXiLine = {0, 1, 1, 0};
// Edges as in NonlinearElement: 0-1, 3-2, 0-3, 1-2.
constexpr std::array<size_t, 4> kFrom = {0, 3, 0, 1}, kTo = {1, 2, 3, 2};

template <int kLanes>
struct Vector {
  typedef double Type __attribute__((vector_size(kLanes * 8)));
  typedef int64_t Mask __attribute__((vector_size(kLanes * 8)));
};

template <typename V>
struct Edges {
  V mid[4][3];       // along the edge
  V director[4][3];  // likewise
  V sum[4][3];       // of both directors
};

// Forces on what Edges has.
template <typename V>
struct OnEdges {
  V mid[4][3], director[4][3], sum[4][3];
};

template <typename V>
TACLINK_IN_KERNEL void SetEdges(const V (&x)[4][6], Edges<V>& edges) {
  for (size_t t = 0; t < 4; ++t) {
    for (size_t a = 0; a < 3; ++a) {
      edges.mid[t][a] = x[kTo[t]][a] - x[kFrom[t]][a];
      edges.director[t][a] = x[kTo[t]][3 + a] - x[kFrom[t]][3 + a];
      edges.sum[t][a] = x[kTo[t]][3 + a] + x[kFrom[t]][3 + a];
    }
  }
}

template <typename V>
TACLINK_IN_KERNEL void SetDot(const V (&a)[3], const V (&b)[3], V& dot) {
  dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Incompressible neo-Hookean sheet in plane stress (PlaneStressOf): adds to the forces by the covariant
// strains `c` and to the energy.
template <typename V, typename Mask>
TACLINK_IN_KERNEL void AddNeoHookean(const RingPoint& point, double modulus_mpa, const V (&c)[3], V (&q)[3],
                                     V& energy) {
  const double mu = modulus_mpa / 3;
  const auto& in = point.in_plane;
  V strain[3];
  for (size_t k = 0; k < 3; ++k) strain[k] = in[k][0] * c[0] + in[k][1] * c[1] + in[k][2] * c[2];
  const V c11 = 1 + 2 * strain[0], c22 = 1 + 2 * strain[1], c12 = strain[2];
  const V det = c11 * c22 - c12 * c12, inverse = 1 / det;
  const Mask exists = (det > 0) & (c11 > 0);
  const V infinite = V{} + std::numeric_limits<double>::infinity(),
          none = V{} + std::numeric_limits<double>::quiet_NaN();
  const V stored = 0.5 * mu * (c11 + c22 + inverse - 3);
  energy += point.weight_mm3 * (exists ? stored : infinite);
  const V scale = exists ? V{} + mu * point.weight_mm3 : none;
  const V s11 = scale * (1 - c22 * inverse * inverse), s22 = scale * (1 - c11 * inverse * inverse),
          s12 = scale * c12 * inverse * inverse;
  for (size_t l = 0; l < 3; ++l) q[l] += in[0][l] * s11 + in[1][l] * s22 + in[2][l] * s12;
}

// Covariant base vectors at one height: along xi by line of eta, along eta by line of xi.
template <typename V>
struct Base {
  V g1[2][3], g2[2][3];
};

template <typename V>
TACLINK_IN_KERNEL void SetBase(const Edges<V>& edges, double height_mm, Base<V>& base) {
  for (size_t a = 0; a < 3; ++a) {
    V p[4];
    for (size_t t = 0; t < 4; ++t) p[t] = edges.mid[t][a] + height_mm * edges.director[t][a];
    base.g1[0][a] = kNear * p[0] + kFar * p[1];
    base.g1[1][a] = kFar * p[0] + kNear * p[1];
    base.g2[0][a] = kNear * p[2] + kFar * p[3];
    base.g2[1][a] = kFar * p[2] + kNear * p[3];
  }
}

// The Gauss points at one height. `tying_force` is without the tying shears' own.
template <typename V, typename Mask, MaterialLaw kLaw, bool kWithForces>
TACLINK_IN_KERNEL void AddLayer(const std::array<RingPoint, 4>& points, double height_mm, double modulus_mpa,
                                const Edges<V>& edges, const V (&tying)[4], V (&tying_force)[4],
                                OnEdges<V>& on, V& energy) {
  Base<V> base;
  SetBase(edges, height_mm, base);
  const auto& [g1, g2] = base;
  V s11[2], s22[2];
  V f1[2][3] = {}, f2[2][3] = {};
  for (size_t line = 0; line < 2; ++line) {
    SetDot(g1[line], g1[line], s11[line]);
    SetDot(g2[line], g2[line], s22[line]);
  }
  for (size_t p = 0; p < 4; ++p) {
    const RingPoint& k = points[p];
    const size_t e = kEtaLine[p], x = kXiLine[p];
    V s12;
    SetDot(g1[e], g2[x], s12);
    const V c[3] = {0.5 * (s11[e] - k.rest_metric[0]), 0.5 * (s22[x] - k.rest_metric[1]),
                    s12 - 0.5 * k.rest_metric[2]};
    const std::array<double, 6>& m = k.membrane;
    V own[3] = {m[0] * c[0] + m[3] * c[1] + m[4] * c[2], m[3] * c[0] + m[1] * c[1] + m[5] * c[2],
                m[4] * c[0] + m[5] * c[1] + m[2] * c[2]};
    V sheared[3];
    for (size_t l = 0; l < 3; ++l) {
      const std::array<double, 4>& n = k.coupling[l];
      sheared[l] = n[0] * tying[0] + n[1] * tying[1] + n[2] * tying[2] + n[3] * tying[3];
      energy += c[l] * (0.5 * own[l] + sheared[l]);
      if constexpr (kWithForces) {
        for (size_t t = 0; t < 4; ++t) tying_force[t] += n[t] * c[l];
      }
    }
    V q[3] = {own[0] + sheared[0], own[1] + sheared[1], own[2] + sheared[2]};
    if constexpr (kLaw == MaterialLaw::kNeoHookean) AddNeoHookean<V, Mask>(k, modulus_mpa, c, q, energy);
    if constexpr (!kWithForces) continue;
    for (size_t a = 0; a < 3; ++a) {
      f1[e][a] += q[0] * g1[e][a] + q[2] * g2[x][a];
      f2[x][a] += q[1] * g2[x][a] + q[2] * g1[e][a];
    }
  }
  if constexpr (!kWithForces) return;
  for (size_t a = 0; a < 3; ++a) {
    const V forces[4] = {kNear * f1[0][a] + kFar * f1[1][a], kFar * f1[0][a] + kNear * f1[1][a],
                         kNear * f2[0][a] + kFar * f2[1][a], kFar * f2[0][a] + kNear * f2[1][a]};
    for (size_t t = 0; t < 4; ++t) {
      on.mid[t][a] += forces[t];
      on.director[t][a] += height_mm * forces[t];
    }
  }
}

// The transverse shears at the middles of the edges, where they are tied, and their own stiffness.
template <typename V>
TACLINK_IN_KERNEL void SetTying(const RingCoefficients& ring, double thickness_mm, const Edges<V>& edges,
                                V (&tying)[4], V (&force)[4], V& energy) {
  for (size_t t = 0; t < 4; ++t) {
    SetDot(edges.mid[t], edges.sum[t], tying[t]);
    tying[t] = thickness_mm / 8 * tying[t] - ring.rest_tying_mm[t];
  }
  for (size_t t = 0; t < 4; ++t) {
    const std::array<double, 4>& k = ring.tying_stiffness[t];
    force[t] = k[0] * tying[0] + k[1] * tying[1] + k[2] * tying[2] + k[3] * tying[3];
    energy += 0.5 * tying[t] * force[t];
  }
}

// FollowerPressure, at the same Gauss points.
template <typename V, bool kWithForces>
TACLINK_IN_KERNEL void AddPressure(double pressure_mpa, const V (&x)[4][6], const Edges<V>& edges,
                                   V (&y)[4][6], V& energy) {
  const double scale = -pressure_mpa / 3;
  Base<V> base;
  SetBase(edges, 0, base);
  for (size_t p = 0; p < 4; ++p) {
    const ShapeFunctions n = ShapeFunctionsAt(kGaussPoints[p][0], kGaussPoints[p][1]);
    const V(&u)[3] = base.g1[kEtaLine[p]];
    const V(&v)[3] = base.g2[kXiLine[p]];
    V at[3];
    for (size_t a = 0; a < 3; ++a)
      at[a] = n.value[0] * x[0][a] + n.value[1] * x[1][a] + n.value[2] * x[2][a] + n.value[3] * x[3][a];
    for (size_t a = 0; a < 3; ++a) {
      const size_t b = (a + 1) % 3, c = (a + 2) % 3;
      const V area = scale * (u[b] * v[c] - u[c] * v[b]);
      energy += at[a] * area;
      if constexpr (!kWithForces) continue;
      const V side1 = scale * (v[b] * at[c] - v[c] * at[b]), side2 = scale * (at[b] * u[c] - at[c] * u[b]);
      for (size_t i = 0; i < 4; ++i) {
        const auto k = static_cast<Eigen::Index>(i);
        y[i][a] += n.value[k] * area + n.by_xi[k] * side1 + n.by_eta[k] * side2;
      }
    }
  }
}

template <typename V>
TACLINK_IN_KERNEL void SetCornerForces(const Edges<V>& edges, double thickness_mm, const V (&tying_force)[4],
                                       OnEdges<V>& on, V (&y)[4][6]) {
  for (size_t t = 0; t < 4; ++t) {
    const V s = thickness_mm / 8 * tying_force[t];
    for (size_t a = 0; a < 3; ++a) {
      on.mid[t][a] += s * edges.sum[t][a];
      on.sum[t][a] = s * edges.mid[t][a];
    }
  }
  for (auto& corner : y) {
    for (V& force : corner) force = V{};
  }
  for (size_t t = 0; t < 4; ++t) {
    for (size_t a = 0; a < 3; ++a) {
      y[kFrom[t]][a] -= on.mid[t][a];
      y[kTo[t]][a] += on.mid[t][a];
      y[kFrom[t]][3 + a] += on.sum[t][a] - on.director[t][a];
      y[kTo[t]][3 + a] += on.sum[t][a] + on.director[t][a];
    }
  }
}

struct Arguments {
  const RingElements& elements;
  const RingField& state;
  double pressure_mpa;
  RingField* forces;
};

// The elements of a ring from a column on, as many as a vector has lanes; those beyond the last column, which
// are copies of the first, do not count.
template <int kLanes, MaterialLaw kLaw, bool kWithForces>
TACLINK_IN_KERNEL void AddElements(const Arguments& in, size_t ring, int column, double& energy_nmm) {
  using V = typename Vector<kLanes>::Type;
  using Mask = typename Vector<kLanes>::Mask;
  const RingCoefficients& k = in.elements.rings[ring];
  const auto row = static_cast<int>(ring);
  V x[4][6];
  for (int a = 0; a < 6; ++a) {
    std::memcpy(&x[0][a], in.state.At(row, a) + column, sizeof(V));
    std::memcpy(&x[1][a], in.state.At(row, a) + column + 1, sizeof(V));
    std::memcpy(&x[2][a], in.state.At(row + 1, a) + column + 1, sizeof(V));
    std::memcpy(&x[3][a], in.state.At(row + 1, a) + column, sizeof(V));
  }
  Edges<V> edges;
  SetEdges(x, edges);
  V energy = {}, tying[4], tying_force[4], y[4][6];
  SetTying(k, in.elements.thickness_mm, edges, tying, tying_force, energy);
  OnEdges<V> on = {};
  for (size_t layer = 0; layer < 2; ++layer) {
    AddLayer<V, Mask, kLaw, kWithForces>(k.points[layer], k.heights_mm[layer],
                                         in.elements.material.youngs_modulus_mpa, edges, tying, tying_force,
                                         on, energy);
  }
  if constexpr (kWithForces) SetCornerForces(edges, in.elements.thickness_mm, tying_force, on, y);
  if (in.pressure_mpa != 0) AddPressure<V, kWithForces>(in.pressure_mpa, x, edges, y, energy);
  const int count = std::min(kLanes, in.state.columns() - column);
  for (int lane = 0; lane < count; ++lane) energy_nmm += energy[lane];
  if constexpr (!kWithForces) return;
  if (count < kLanes) {
    for (auto& corner : y) {
      for (V& force : corner) {
        for (int lane = count; lane < kLanes; ++lane) force[lane] = 0;
      }
    }
  }
  constexpr std::array<int, 4> kRow = {0, 0, 1, 1}, kColumn = {0, 1, 1, 0};
  for (size_t i = 0; i < 4; ++i) {
    for (int a = 0; a < 6; ++a) {
      double* to = in.forces->At(row + kRow[i], a) + column + kColumn[i];
      V sum;
      std::memcpy(&sum, to, sizeof(V));
      sum += y[i][static_cast<size_t>(a)];
      std::memcpy(to, &sum, sizeof(V));
    }
  }
}

template <int kLanes, MaterialLaw kLaw, bool kWithForces>
TACLINK_IN_KERNEL double AddRings(const Arguments& in) {
  double energy_nmm = 0;
  for (size_t ring = 0; ring < in.elements.rings.size(); ++ring) {
    for (int column = 0; column < in.state.columns(); column += kLanes)
      AddElements<kLanes, kLaw, kWithForces>(in, ring, column, energy_nmm);
  }
  return energy_nmm;
}

template <int kLanes>
TACLINK_IN_KERNEL double Run(const Arguments& in) {
  constexpr auto kLinear = MaterialLaw::kSaintVenantKirchhoff, kRubber = MaterialLaw::kNeoHookean;
  if (in.elements.material.law == kRubber)
    return in.forces != nullptr ? AddRings<kLanes, kRubber, true>(in) : AddRings<kLanes, kRubber, false>(in);
  return in.forces != nullptr ? AddRings<kLanes, kLinear, true>(in) : AddRings<kLanes, kLinear, false>(in);
}

double RunPlain(const Arguments& in) {
  return Run<2>(in);
}
TACLINK_FOR_AVX2 double RunAvx2(const Arguments& in) {
  return Run<4>(in);
}
TACLINK_FOR_AVX512 double RunAvx512(const Arguments& in) {
  return Run<8>(in);
}

}  // namespace

double RingElements::Forces(const RingField& state, double pressure_mpa, RingField* forces) const {
  static double (*const kKernel)(const Arguments&) = BestOf(RunPlain, RunAvx2, RunAvx512);
  if (forces == nullptr) return kKernel({*this, state, pressure_mpa, nullptr});
  const auto rows = static_cast<int>(rings.size()) + 1;
  forces->Resize(rows, state.columns());
  std::fill_n(forces->data(), rows * RingField::kComponents * forces->stride(), 0.0);
  const double energy_nmm = kKernel({*this, state, pressure_mpa, forces});
  for (int row = 0; row < rows; ++row) {
    for (int a = 0; a < RingField::kComponents; ++a) {
      double* values = forces->At(row, a);
      values[0] += values[state.columns()];  // from the last element around
    }
  }
  return energy_nmm;
}

}  // namespace taclink
