#include "sensing/shell/marker_map.h"

#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

Vec3 AreaVector(std::span<const Vec3> mids_mm, const std::array<int, 4>& quad) {
  const auto at = [&](size_t i) -> const Vec3& { return mids_mm[static_cast<size_t>(quad[i])]; };
  return 0.5 * (at(2) - at(0)).cross(at(3) - at(1));
}

double AreaOf(std::span<const Vec3> mids_mm, const std::array<std::array<int, 4>, 4>& quads) {
  double area = 0;
  for (const auto& quad : quads) area += AreaVector(mids_mm, quad).norm();
  return area;
}

}  // namespace

MarkerMap::MarkerMap(const LinkModel& model, const ShellMesh& mesh)
    : half_thickness_mm_(model.thickness_mm / 2),
      dome_mm_(model.markers.center_depth_mm - model.thickness_mm) {
  const auto element = [&](int column, int row) {
    return mesh.elements[static_cast<size_t>(mesh.Node(column, row))];
  };
  for (int m = 0; m < model.markers.count(); ++m) {
    const int node = mesh.NodeOfMarker(model, m), column = mesh.Column(node), row = mesh.Row(node);
    nodes_.push_back(node);
    around_.push_back({element(column - 1, row - 1), element(column, row - 1), element(column - 1, row),
                       element(column, row)});
    rest_area_mm2_.push_back(AreaOf(mesh.mid_mm, around_.back()));
  }
  for (int m = 0; m < markers(); ++m) rest_mm_.push_back(Position(mesh.mid_mm, mesh.normals, m));
}

double MarkerMap::HalfThickness(std::span<const Vec3> mids_mm, int marker) const {
  const auto m = static_cast<size_t>(marker);
  return half_thickness_mm_ * rest_area_mm2_[m] / AreaOf(mids_mm, around_[m]);
}

Vec3 MarkerMap::Position(std::span<const Vec3> mids_mm, std::span<const Vec3> directors, int marker) const {
  const auto node = static_cast<size_t>(nodes_[static_cast<size_t>(marker)]);
  return mids_mm[node] - (HalfThickness(mids_mm, marker) + dome_mm_) * directors[node];
}

void MarkerMap::Displacements(const ShellState& state, Eigen::VectorXd& stacked_mm) const {
  stacked_mm.resize(3 * markers());
  for (int m = 0; m < markers(); ++m)
    stacked_mm.segment<3>(3 * m) =
        Position(state.mids_mm, state.directors, m) - rest_mm_[static_cast<size_t>(m)];
}

Eigen::Matrix<double, 3, 5> MarkerMap::OwnJacobian(const ShellState& state, int marker) const {
  const auto node = static_cast<size_t>(nodes_[static_cast<size_t>(marker)]);
  const Vec3& d = state.directors[node];
  const Vec3& t = state.tangents[node];
  const double depth = HalfThickness(state.mids_mm, marker) + dome_mm_;
  Eigen::Matrix<double, 3, 5> own;
  own.leftCols<3>().setIdentity();
  own.col(3) = -depth * t.cross(d);
  own.col(4) = -depth * t;  // (d x t) x d
  return own;
}

// Calls visit(dof, column of the derivative); a degree of freedom may come more than once.
template <typename Visit>
void MarkerMap::ForEachEntry(const NonlinearShell& shell, const ShellState& state, int marker,
                             Visit visit) const {
  const auto m = static_cast<size_t>(marker);
  const Eigen::Matrix<double, 3, 5> own = OwnJacobian(state, marker);
  for (int c = 0; c < 5; ++c) {
    if (const int dof = shell.Dof(nodes_[m], c); dof >= 0) visit(dof, Vec3(own.col(c)));
  }
  // d(A0/A) = -A0/A^2 dA; dA = n . 1/2 (dd1 x d2 + d1 x dd2) of each element, d1 and d2 its diagonals.
  const double area = AreaOf(state.mids_mm, around_[m]);
  const double weight = half_thickness_mm_ * rest_area_mm2_[m] / (area * area);
  const Vec3& director = state.directors[static_cast<size_t>(nodes_[m])];
  for (const Quad& quad : around_[m]) {
    const auto at = [&](size_t i) -> const Vec3& { return state.mids_mm[static_cast<size_t>(quad[i])]; };
    const Vec3 d1 = at(2) - at(0), d2 = at(3) - at(1);
    const Vec3 normal = d1.cross(d2).normalized();
    const Vec3 by_d1 = 0.5 * d2.cross(normal), by_d2 = 0.5 * normal.cross(d1);
    const std::array<Vec3, 4> by_corner = {-by_d1, -by_d2, by_d1, by_d2};
    for (size_t i = 0; i < 4; ++i) {
      for (int c = 0; c < 3; ++c) {
        if (const int dof = shell.Dof(quad[i], c); dof >= 0)
          visit(dof, Vec3(weight * by_corner[i][c] * director));
      }
    }
  }
}

MarkerMap::Jacobian MarkerMap::MakeJacobian(const NonlinearShell& shell) const {
  std::vector<Eigen::Triplet<double>> entries;
  const ShellState rest = shell.Rest();
  for (int m = 0; m < markers(); ++m) {
    ForEachEntry(shell, rest, m, [&](int dof, const Vec3&) {
      for (int a = 0; a < 3; ++a) entries.emplace_back(3 * m + a, dof, 0.0);
    });
  }
  Jacobian jacobian(3 * markers(), shell.dof_count());
  jacobian.setFromTriplets(entries.begin(), entries.end());
  jacobian.makeCompressed();
  return jacobian;
}

void MarkerMap::WriteJacobian(const NonlinearShell& shell, const ShellState& state,
                              Jacobian& jacobian) const {
  std::fill(jacobian.valuePtr(), jacobian.valuePtr() + jacobian.nonZeros(), 0.0);
  const int* outer = jacobian.outerIndexPtr();
  const int* inner = jacobian.innerIndexPtr();
  for (int m = 0; m < markers(); ++m) {
    const int* first = inner + outer[3 * m];
    const int* last = inner + outer[3 * m + 1];
    ForEachEntry(shell, state, m, [&](int dof, const Vec3& by) {
      const auto slot = std::lower_bound(first, last, dof) - first;  // the same in all three rows
      for (int a = 0; a < 3; ++a) jacobian.valuePtr()[outer[3 * m + a] + slot] += by[a];
    });
  }
}

}  // namespace taclink
