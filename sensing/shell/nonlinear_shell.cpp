#include "sensing/shell/nonlinear_shell.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace taclink {
namespace {

// d(director) by the rotations about tangent and director x tangent.
Eigen::Matrix<double, 3, 2> TurnsOf(const Vec3& director, const Vec3& tangent) {
  Eigen::Matrix<double, 3, 2> turns;
  turns.col(0) = tangent.cross(director);
  turns.col(1) = tangent;
  return turns;
}

// Of a turn by an angle: cos a, sin a / a and (1 - cos a) / a^2.
struct TurnSharesOf {
  double cosine, sine_share, versine_share;
};
TurnSharesOf TurnShares(double angle2) {
  if (angle2 > 0.1) {
    const double angle = std::sqrt(angle2);
    return {std::cos(angle), std::sin(angle) / angle, (1 - std::cos(angle)) / angle2};
  }
  // Series, exact to rounding up to there.
  const double x = angle2;
  const double sine_share =
      1 - x / 6 * (1 - x / 20 * (1 - x / 42 * (1 - x / 72 * (1 - x / 110 * (1 - x / 156)))));
  const double versine_share =
      0.5 * (1 - x / 12 * (1 - x / 30 * (1 - x / 56 * (1 - x / 90 * (1 - x / 132 * (1 - x / 182))))));
  return {1 - x * versine_share, sine_share, versine_share};
}

}  // namespace

ShellSurface SkinSurface(const ShellMesh& mesh) {
  ShellSurface surface{.mids_mm = mesh.mid_mm,
                       .directors = mesh.normals,
                       .tangents = {},
                       .elements = mesh.elements,
                       .thickness_mm = mesh.thickness_mm,
                       .columns = mesh.columns,
                       .fixed = {}};
  for (int node = 0; node < mesh.node_count(); ++node) {
    const Vec3& normal = mesh.normals[static_cast<size_t>(node)];
    surface.tangents.push_back(Vec3(-normal.y(), normal.x(), 0).normalized());  // around, however it slopes
    const bool clamped = mesh.IsClamped(node);
    surface.fixed.push_back({clamped, clamped, clamped, clamped, clamped});
  }
  return surface;
}

NonlinearShell::NonlinearShell(ShellSurface surface, const Material& material)
    : surface_(std::move(surface)), material_(material) {
  assert(surface_.fixed.size() == surface_.mids_mm.size());
  const ShellState rest = Rest();
  for (size_t e = 0; e < surface_.elements.size(); ++e) {
    elements_.emplace_back(StateOf(static_cast<int>(e), rest), surface_.thickness_mm, material_);
  }
  rings_ = RingShell::Make(surface_, elements_, material_);
  if (rings_) {
    std::vector<NonlinearElement> kept;
    for (size_t e = 0; e < elements_.size(); e += static_cast<size_t>(surface_.columns))
      kept.push_back(elements_[e]);
    elements_ = std::move(kept);
  }
  for (const auto& fixed : surface_.fixed) {
    std::array<int, 5> dofs{};
    for (size_t c = 0; c < 5; ++c) dofs[c] = fixed[c] ? -1 : dof_count_++;
    dofs_.push_back(dofs);
  }
  MakePattern();
}

ElementState NonlinearShell::StateOf(int element, const ShellState& state) const {
  ElementState q;
  for (size_t i = 0; i < 4; ++i) {
    const auto node = static_cast<size_t>(surface_.elements[static_cast<size_t>(element)][i]);
    q.segment<3>(static_cast<Eigen::Index>(6 * i)) = state.mids_mm[node];
    q.segment<3>(static_cast<Eigen::Index>(6 * i + 3)) = state.directors[node];
  }
  return q;
}

void NonlinearShell::MakePattern() {
  std::vector<Eigen::Triplet<double>> entries;
  const auto for_pairs = [this](auto visit) {
    for (size_t e = 0; e < surface_.elements.size(); ++e) {
      for (int j = 0; j < kElementDofs; ++j) {
        for (int i = 0; i < kElementDofs; ++i) {
          const auto& nodes = surface_.elements[e];
          const int row = Dof(nodes[static_cast<size_t>(i / 5)], i % 5);
          const int column = Dof(nodes[static_cast<size_t>(j / 5)], j % 5);
          visit(e, static_cast<size_t>(j * kElementDofs + i), row, column);
        }
      }
    }
  };
  for_pairs([&](size_t, size_t, int row, int column) {
    if (column >= 0 && row >= column) entries.emplace_back(row, column, 0.0);
  });
  pattern_.resize(dof_count_, dof_count_);
  pattern_.setFromTriplets(entries.begin(), entries.end());
  pattern_.makeCompressed();
  slots_.resize(surface_.elements.size());
  for_pairs([&](size_t e, size_t k, int row, int column) {
    slots_[e][k] = -1;
    if (column < 0 || row < column) return;
    const int* first = pattern_.innerIndexPtr() + pattern_.outerIndexPtr()[column];
    const int* last = pattern_.innerIndexPtr() + pattern_.outerIndexPtr()[column + 1];
    slots_[e][k] = static_cast<int>(std::lower_bound(first, last, row) - pattern_.innerIndexPtr());
  });
}

template <typename Visit>
double NonlinearShell::ForEachElement(DerivativeOrder order, const ShellState& state, Loads loads,
                                      Visit visit) const {
  double energy = 0;
  ElementResponse response;
  for (int e = 0; e < static_cast<int>(surface_.elements.size()); ++e) {
    response.SetZero(order);
    const ElementState q = StateOf(e, state);
    Element(e).Add(order, q, response);
    for (const ElementLoad* load : loads) load->Add(order, e, q, response);
    energy += response.energy_nmm;
    visit(e, response);
  }
  return energy;
}

void NonlinearShell::AddAtNode(const ShellState& state, int node, const Vec3& force, const Vec3& by_director,
                               Eigen::VectorXd& gradient) const {
  const auto i = static_cast<size_t>(node);
  const std::array<int, 5>& dofs = dofs_[i];
  for (size_t c = 0; c < 3; ++c) {
    if (dofs[c] >= 0) gradient[dofs[c]] += force[static_cast<Eigen::Index>(c)];
  }
  const Vec2 moments = TurnsOf(state.directors[i], state.tangents[i]).transpose() * by_director;
  if (dofs[3] >= 0) gradient[dofs[3]] += moments[0];
  if (dofs[4] >= 0) gradient[dofs[4]] += moments[1];
}

// With pressures; other loads element by element.
double NonlinearShell::ByRings(DerivativeOrder order, const ShellState& state, Loads loads,
                               Eigen::VectorXd* gradient) const {
  double pressure_mpa = 0;
  for (const ElementLoad* load : loads) pressure_mpa += load->uniform_pressure_mpa();
  const auto is_other = [](const ElementLoad* load) { return load->uniform_pressure_mpa() == 0; };
  double energy = 0;
  if (gradient == nullptr) {
    energy = rings_->Energy(state, pressure_mpa);
  } else {
    thread_local RingField forces;
    energy = rings_->Forces(state, pressure_mpa, forces);
    for (int node = 0; node < node_count(); ++node) {
      const int row = node / rings_->columns(), column = node % rings_->columns();
      AddAtNode(state, node, forces.Mid(row, column), forces.Director(row, column), *gradient);
    }
  }
  if (std::ranges::none_of(loads, is_other)) return energy;
  ElementResponse response;
  for (int e = 0; e < static_cast<int>(surface_.elements.size()); ++e) {
    response.SetZero(order);
    const ElementState q = StateOf(e, state);
    for (const ElementLoad* load : loads) {
      if (is_other(load)) load->Add(order, e, q, response);
    }
    energy += response.energy_nmm;
    if (gradient != nullptr) AddAtCorners(state, e, response, *gradient);
  }
  return energy;
}

double NonlinearShell::Energy(const ShellState& state, Loads loads) const {
  if (rings_) return ByRings(DerivativeOrder::kEnergy, state, loads, nullptr);
  return ForEachElement(DerivativeOrder::kEnergy, state, loads, [](int, const ElementResponse&) {});
}

double NonlinearShell::Gradient(const ShellState& state, Loads loads, Eigen::VectorXd& gradient) const {
  gradient.setZero(dof_count_);
  if (rings_) return ByRings(DerivativeOrder::kGradient, state, loads, &gradient);
  return ForEachElement(
      DerivativeOrder::kGradient, state, loads,
      [&](int e, const ElementResponse& response) { AddAtCorners(state, e, response, gradient); });
}

void NonlinearShell::AddAtCorners(const ShellState& state, int element, const ElementResponse& response,
                                  Eigen::VectorXd& gradient) const {
  for (size_t i = 0; i < 4; ++i) {
    const auto at = static_cast<Eigen::Index>(6 * i);
    AddAtNode(state, surface_.elements[static_cast<size_t>(element)][i], response.gradient.segment<3>(at),
              response.gradient.segment<3>(at + 3), gradient);
  }
}

// From points and directors to the corners' degrees of freedom.
void NonlinearShell::SetPart(int element, const ShellState& state, const ElementResponse& response,
                             ElementPart& part) const {
  std::array<Eigen::Matrix<double, 3, 2>, 4> turns;
  Eigen::Matrix<double, 24, kElementDofs> half;
  const auto& nodes = surface_.elements[static_cast<size_t>(element)];
  part.energy_nmm = response.energy_nmm;
  for (size_t i = 0; i < 4; ++i) {
    const auto node = static_cast<size_t>(nodes[i]);
    const auto at = static_cast<Eigen::Index>(6 * i), to = static_cast<Eigen::Index>(5 * i);
    turns[i] = TurnsOf(state.directors[node], state.tangents[node]);
    part.gradient.segment<3>(to) = response.gradient.segment<3>(at);
    part.gradient.segment<2>(to + 3) = turns[i].transpose() * response.gradient.segment<3>(at + 3);
    half.middleCols<3>(to) = response.hessian.middleCols<3>(at);
    half.middleCols<2>(to + 3) = response.hessian.middleCols<3>(at + 3).lazyProduct(turns[i]);
  }
  auto& k = part.hessian;
  for (size_t i = 0; i < 4; ++i) {
    const auto node = static_cast<size_t>(nodes[i]);
    const auto at = static_cast<Eigen::Index>(6 * i), to = static_cast<Eigen::Index>(5 * i);
    k.middleRows<3>(to) = half.middleRows<3>(at);
    k.middleRows<2>(to + 3) = turns[i].transpose().lazyProduct(half.middleRows<3>(at + 3));
    // A director that turns comes nearer to its own axis by half the angle squared.
    const double sinking = response.gradient.segment<3>(at + 3).dot(state.directors[node]);
    k(to + 3, to + 3) -= sinking;
    k(to + 4, to + 4) -= sinking;
  }
}

void NonlinearShell::SetElementPart(int element, const ShellState& state, Loads loads,
                                    ElementPart& part) const {
  ElementResponse response;
  response.SetZero(DerivativeOrder::kHessian);
  const ElementState q = StateOf(element, state);
  Element(element).Add(DerivativeOrder::kHessian, q, response);
  for (const ElementLoad* load : loads) load->Add(DerivativeOrder::kHessian, element, q, response);
  SetPart(element, state, response, part);
}

double NonlinearShell::Hessian(const ShellState& state, Loads loads, Eigen::VectorXd& gradient,
                               Eigen::SparseMatrix<double>& hessian) const {
  assert(hessian.nonZeros() == pattern_.nonZeros());
  gradient.setZero(dof_count_);
  double* values = hessian.valuePtr();
  std::fill(values, values + hessian.nonZeros(), 0.0);
  ElementPart part;
  return ForEachElement(DerivativeOrder::kHessian, state, loads, [&](int e, const ElementResponse& response) {
    SetPart(e, state, response, part);
    const auto& nodes = surface_.elements[static_cast<size_t>(e)];
    for (int j = 0; j < kElementDofs; ++j) {
      const int column = Dof(nodes[static_cast<size_t>(j / 5)], j % 5);
      if (column < 0) continue;
      gradient[column] += part.gradient[j];
      for (int i = 0; i < kElementDofs; ++i) {
        const int slot = slots_[static_cast<size_t>(e)][static_cast<size_t>(j * kElementDofs + i)];
        if (slot >= 0) values[slot] += part.hessian(i, j);
      }
    }
  });
}

// Rodrigues' formula about an axis across the director.
void NonlinearShell::StepNode(int node, const Eigen::Matrix<double, 5, 1>& by, ShellState& state) {
  const auto i = static_cast<size_t>(node);
  state.mids_mm[i] += by.head<3>();
  Vec3& d = state.directors[i];
  Vec3& t = state.tangents[i];
  const Vec3 turn = by[3] * t + by[4] * d.cross(t);
  const double angle2 = turn.squaredNorm();
  if (angle2 == 0) return;
  const auto [cosine, sine_share, versine_share] = TurnShares(angle2);
  const Vec3 turned = cosine * d + sine_share * turn.cross(d);
  t = cosine * t + sine_share * turn.cross(t) + versine_share * turn.dot(t) * turn;
  d = turned.normalized();
  t = (t - t.dot(d) * d).normalized();
}

void NonlinearShell::Step(const Eigen::VectorXd& increment, ShellState& state) const {
  Eigen::Matrix<double, 5, 1> by;
  for (int node = 0; node < node_count(); ++node) {
    bool moves = false;
    for (int c = 0; c < 5; ++c) {
      const int dof = Dof(node, c);
      by[c] = dof >= 0 ? increment[dof] : 0.0;
      moves = moves || dof >= 0;
    }
    if (moves) StepNode(node, by, state);
  }
}

}  // namespace taclink
