#include "sensing/shell/ring_shell.h"

#include <algorithm>
#include <cmath>

#include "sensing/shell/nonlinear_shell.h"

namespace taclink {
namespace {

constexpr double kAlike = 1e-7;  // of the largest coefficient of its kind
constexpr int kFewestColumns = 3;

// In-plane stiffness by Cartesian strains e11, e22, 2 e12 of a law that is linear.
Mat3 LinearLaw(const Material& material) {
  const double nu = material.poisson_ratio, c = material.youngs_modulus_mpa / (1 - nu * nu);
  Mat3 law;
  law << c, c * nu, 0, c * nu, c, 0, 0, 0, c * (1 - nu) / 2;
  return law;
}

RingPoint PointOf(const NonlinearElement& element, const NonlinearElement::Layer& layer, size_t p,
                  const Material& material) {
  const auto row = [&](const Lanes3& lanes) { return Vec3(lanes[0][p], lanes[1][p], lanes[2][p]); };
  const double weight_mm3 = layer.weight_mm3[p];
  Mat3 in_plane;
  for (size_t k = 0; k < 3; ++k) in_plane.row(static_cast<Eigen::Index>(k)) = row(layer.in_plane[k]);
  Mat3 membrane = Mat3::Zero();
  Eigen::Matrix<double, 3, 4> coupling = Eigen::Matrix<double, 3, 4>::Zero();
  for (size_t k = 0; k < 2; ++k) {
    const double modulus = weight_mm3 * element.shear_moduli_mpa()[k];
    const Vec3 warp = row(layer.warp[k]);
    const auto& shear = layer.shear[k];
    membrane += modulus * warp * warp.transpose();
    coupling += modulus * warp * Eigen::RowVector4d(shear[0][p], shear[1][p], shear[2][p], shear[3][p]);
  }
  RingPoint point;
  if (material.law == MaterialLaw::kNeoHookean) {
    point.weight_mm3 = weight_mm3;
    for (size_t k = 0; k < 3; ++k)
      Vec3::Map(point.in_plane[k].data()) = in_plane.row(static_cast<Eigen::Index>(k)).transpose();
  } else {
    membrane += weight_mm3 * in_plane.transpose() * LinearLaw(material) * in_plane;
  }
  point.membrane = {membrane(0, 0), membrane(1, 1), membrane(2, 2),
                    membrane(0, 1), membrane(0, 2), membrane(1, 2)};
  for (size_t k = 0; k < 3; ++k)
    Eigen::RowVector4d::Map(point.coupling[k].data()) = coupling.row(static_cast<Eigen::Index>(k));
  Vec3::Map(point.rest_metric.data()) = row(layer.rest_metric);
  return point;
}

RingCoefficients RingOf(const NonlinearElement& element, const Material& material) {
  RingCoefficients ring;
  for (size_t l = 0; l < 2; ++l) {
    const NonlinearElement::Layer& layer = element.layers()[l];
    ring.heights_mm[l] = layer.height_mm;
    for (size_t p = 0; p < 4; ++p) ring.points[l][p] = PointOf(element, layer, p, material);
  }
  for (size_t t = 0; t < 4; ++t) {
    const auto at = static_cast<Eigen::Index>(t);
    Eigen::RowVector4d::Map(ring.tying_stiffness[t].data()) = element.tying_stiffness().row(at);
    ring.rest_tying_mm[t] = element.rest_tying()[at];
  }
  return ring;
}

// Numbers of each kind, which have a scale of their own.
template <typename Visit>
void ForEachKind(const RingCoefficients& ring, Visit visit) {
  for (const auto& layer : ring.points) {
    for (const RingPoint& point : layer) {
      visit(0, std::span<const double>(point.membrane));
      for (const auto& row : point.coupling) visit(1, std::span<const double>(row));
      visit(2, std::span<const double>(point.rest_metric));
      for (const auto& row : point.in_plane) visit(3, std::span<const double>(row));
    }
  }
  for (const auto& row : ring.tying_stiffness) visit(4, std::span<const double>(row));
  visit(5, std::span<const double>(ring.rest_tying_mm));
}

// As MakeShellMesh numbers nodes and elements.
bool IsMeshedAround(const ShellSurface& surface) {
  if (surface.columns < kFewestColumns || surface.elements.empty()) return false;
  const auto around = static_cast<size_t>(surface.columns);
  if (surface.elements.size() % around != 0) return false;
  if (surface.mids_mm.size() != surface.elements.size() + around) return false;
  for (size_t e = 0; e < surface.elements.size(); ++e) {
    const int row = static_cast<int>(e / around), column = static_cast<int>(e % around);
    const int first = row * surface.columns, next = (column + 1) % surface.columns;
    const std::array<int, 4> corners = {first + column, first + next, first + surface.columns + next,
                                        first + surface.columns + column};
    if (surface.elements[e] != corners) return false;
  }
  return true;
}

bool AreAlike(const RingCoefficients& a, const RingCoefficients& b) {
  constexpr size_t kKinds = 6;
  std::array<std::vector<double>, kKinds> all;
  ForEachKind(a, [&](size_t kind, auto numbers) {
    all[kind].insert(all[kind].end(), numbers.begin(), numbers.end());
  });
  std::array<double, kKinds> scales{};
  for (size_t kind = 0; kind < kKinds; ++kind) {
    for (const double number : all[kind]) scales[kind] = std::max(scales[kind], std::abs(number));
  }
  scales[5] = std::max(scales[5], std::sqrt(scales[2]));  // the shears at rest vanish: rounding has no scale
  std::array<size_t, kKinds> next{};
  bool alike = true;
  ForEachKind(b, [&](size_t kind, auto numbers) {
    for (const double number : numbers)
      alike = alike && std::abs(number - all[kind][next[kind]++]) <= kAlike * scales[kind];
  });
  return alike;
}

}  // namespace

std::optional<RingShell> RingShell::Make(const ShellSurface& surface,
                                         std::span<const NonlinearElement> elements,
                                         const Material& material) {
  if (!IsMeshedAround(surface)) return std::nullopt;
  const auto around = static_cast<size_t>(surface.columns);
  RingElements kept{.thickness_mm = surface.thickness_mm, .material = material, .rings = {}};
  for (size_t e = 0; e < elements.size(); ++e) {
    RingCoefficients ring = RingOf(elements[e], material);
    if (e % around == 0)
      kept.rings.push_back(ring);
    else if (!AreAlike(kept.rings.back(), ring))
      return std::nullopt;
  }
  return RingShell(surface.columns, std::move(kept));
}

void RingShell::Load(const ShellState& state, RingField& field) const {
  field.Resize(rows(), columns_);
  for (int row = 0; row < rows(); ++row) {
    for (int c = 0; c < 3; ++c) {
      double *mids = field.At(row, c), *directors = field.At(row, 3 + c);
      for (int column = 0; column < columns_; ++column) {
        const auto node = static_cast<size_t>(row * columns_ + column);
        mids[column] = state.mids_mm[node][c];
        directors[column] = state.directors[node][c];
      }
      for (int repeated = 0; repeated < RingField::kRepeated; ++repeated) {
        mids[columns_ + repeated] = mids[repeated % columns_];
        directors[columns_ + repeated] = directors[repeated % columns_];
      }
    }
  }
}

double RingShell::Energy(const ShellState& state, double pressure_mpa) const {
  thread_local RingField field;
  Load(state, field);
  return elements_.Forces(field, pressure_mpa, nullptr);
}

double RingShell::Forces(const ShellState& state, double pressure_mpa, RingField& forces) const {
  thread_local RingField field;
  Load(state, field);
  return elements_.Forces(field, pressure_mpa, &forces);
}

}  // namespace taclink
