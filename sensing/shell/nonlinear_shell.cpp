#include "sensing/shell/nonlinear_shell.h"

#include <algorithm>
#include <cassert>

#include "sensing/shell/mitc4.h"

namespace taclink {
namespace {

// d(director) by the rotations about tangent and director x tangent.
Eigen::Matrix<double, 3, 2> TurnsOf(const Vec3& director, const Vec3& tangent) {
  Eigen::Matrix<double, 3, 2> turns;
  turns.col(0) = tangent.cross(director);
  turns.col(1) = tangent;
  return turns;
}

}  // namespace

ShellSurface SkinSurface(const ShellMesh& mesh) {
  ShellSurface surface{.mids_mm = mesh.mid_mm,
                       .directors = mesh.normals,
                       .tangents = {},
                       .elements = mesh.elements,
                       .thickness_mm = mesh.thickness_mm,
                       .fixed = {}};
  for (int node = 0; node < mesh.node_count(); ++node) {
    surface.tangents.push_back(TangentsOf(mesh.normals[static_cast<size_t>(node)])[0]);
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
  slots_.resize(elements_.size());
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
  for (size_t e = 0; e < elements_.size(); ++e) {
    response.SetZero(order);
    const ElementState q = StateOf(static_cast<int>(e), state);
    elements_[e].Add(order, q, response);
    for (const ElementLoad* load : loads) load->Add(order, static_cast<int>(e), q, response);
    energy += response.energy_nmm;
    visit(e, response);
  }
  return energy;
}

double NonlinearShell::Energy(const ShellState& state, Loads loads) const {
  return ForEachElement(DerivativeOrder::kEnergy, state, loads, [](size_t, const ElementResponse&) {});
}

double NonlinearShell::Gradient(const ShellState& state, Loads loads, Eigen::VectorXd& gradient) const {
  gradient.setZero(dof_count_);
  return ForEachElement(DerivativeOrder::kGradient, state, loads,
                        [&](size_t e, const ElementResponse& response) {
                          for (size_t i = 0; i < 4; ++i) {
                            const auto node = static_cast<size_t>(surface_.elements[e][i]);
                            const auto at = static_cast<Eigen::Index>(6 * i);
                            Eigen::Matrix<double, 5, 1> g;
                            g.head<3>() = response.gradient.segment<3>(at);
                            g.tail<2>() = TurnsOf(state.directors[node], state.tangents[node]).transpose() *
                                          response.gradient.segment<3>(at + 3);
                            for (size_t c = 0; c < 5; ++c) {
                              if (dofs_[node][c] >= 0)
                                gradient[dofs_[node][c]] += g[static_cast<Eigen::Index>(c)];
                            }
                          }
                        });
}

double NonlinearShell::Hessian(const ShellState& state, Loads loads, Eigen::VectorXd& gradient,
                               Eigen::SparseMatrix<double>& hessian) const {
  assert(hessian.nonZeros() == pattern_.nonZeros());
  gradient.setZero(dof_count_);
  double* values = hessian.valuePtr();
  std::fill(values, values + hessian.nonZeros(), 0.0);
  return ForEachElement(
      DerivativeOrder::kHessian, state, loads, [&](size_t e, const ElementResponse& response) {
        std::array<Eigen::Matrix<double, 3, 2>, 4> turns;
        Eigen::Matrix<double, 24, kElementDofs> half;
        Local g;
        for (size_t i = 0; i < 4; ++i) {
          const auto node = static_cast<size_t>(surface_.elements[e][i]);
          const auto at = static_cast<Eigen::Index>(6 * i), to = static_cast<Eigen::Index>(5 * i);
          turns[i] = TurnsOf(state.directors[node], state.tangents[node]);
          g.segment<3>(to) = response.gradient.segment<3>(at);
          g.segment<2>(to + 3) = turns[i].transpose() * response.gradient.segment<3>(at + 3);
          half.middleCols<3>(to) = response.hessian.middleCols<3>(at);
          half.middleCols<2>(to + 3) = response.hessian.middleCols<3>(at + 3).lazyProduct(turns[i]);
        }
        Eigen::Matrix<double, kElementDofs, kElementDofs> k;
        for (size_t i = 0; i < 4; ++i) {
          const auto node = static_cast<size_t>(surface_.elements[e][i]);
          const auto at = static_cast<Eigen::Index>(6 * i), to = static_cast<Eigen::Index>(5 * i);
          k.middleRows<3>(to) = half.middleRows<3>(at);
          k.middleRows<2>(to + 3) = turns[i].transpose().lazyProduct(half.middleRows<3>(at + 3));
          // A director that turns comes nearer to its own axis by half the angle squared.
          const double sinking = response.gradient.segment<3>(at + 3).dot(state.directors[node]);
          k(to + 3, to + 3) -= sinking;
          k(to + 4, to + 4) -= sinking;
        }
        for (int j = 0; j < kElementDofs; ++j) {
          const auto& nodes = surface_.elements[e];
          const int column = Dof(nodes[static_cast<size_t>(j / 5)], j % 5);
          if (column < 0) continue;
          gradient[column] += g[j];
          for (int i = 0; i < kElementDofs; ++i) {
            const int slot = slots_[e][static_cast<size_t>(j * kElementDofs + i)];
            if (slot >= 0) values[slot] += k(i, j);
          }
        }
      });
}

void NonlinearShell::Step(const Eigen::VectorXd& increment, ShellState& state) const {
  for (size_t node = 0; node < dofs_.size(); ++node) {
    const auto value = [&](size_t c) { return dofs_[node][c] >= 0 ? increment[dofs_[node][c]] : 0.0; };
    state.mids_mm[node] += Vec3(value(0), value(1), value(2));
    Vec3& d = state.directors[node];
    Vec3& t = state.tangents[node];
    const Vec3 turn = value(3) * t + value(4) * d.cross(t);
    const double angle = turn.norm();
    if (angle == 0) continue;
    const Eigen::AngleAxisd rotation(angle, turn / angle);
    d = (rotation * d).normalized();
    t = rotation * t;
    t = (t - t.dot(d) * d).normalized();
  }
}

}  // namespace taclink
