#include "sensing/design/skin_geometry.h"

#include <algorithm>
#include <cmath>

namespace taclink {
namespace {

constexpr int kWallRows = 257;

double Radial(const Vec3& point) {
  return point.head<2>().norm();
}

SkinGeometry EmptyGeometry(const LinkModel& model, int columns) {
  return {.length_mm = model.length_mm,
          .dome_radius_mm = model.markers.diameter_mm / 2,
          .tube_radius_mm = model.tube_outer_radius_mm,
          .feet = {},
          .inward = {},
          .rows = kWallRows,
          .columns = columns,
          .first_angle_rad = model.markers.first_path_angle_rad,
          .wall_mm = {}};
}

// Radius and z of the undeformed inner wall at rows of the grid.
std::vector<Vec2> RestWall(const LinkModel& model) {
  std::vector<Vec2> wall;
  for (int row = 0; row < kWallRows; ++row) {
    const Vec3 p = model.PointAtDepth(0, model.length_mm * row / (kWallRows - 1), model.thickness_mm);
    wall.emplace_back(p.x(), p.z());
  }
  return wall;
}

// Resamples a curve of radius over z at the rows of the grid. Points are in the order of z except for folds,
// which are flattened.
std::vector<double> OverZ(const std::vector<Vec2>& curve, double length_mm) {
  std::vector<double> radius;
  size_t i = 0;
  for (int row = 0; row < kWallRows; ++row) {
    const double z = length_mm * row / (kWallRows - 1);
    while (i + 2 < curve.size() && curve[i + 1].y() < z) ++i;
    const Vec2 &a = curve[i], &b = curve[i + 1];
    const double span = b.y() - a.y();
    const double share = span > 0 ? std::clamp((z - a.y()) / span, 0.0, 1.0) : 0;
    radius.push_back((1 - share) * a.x() + share * b.x());
  }
  return radius;
}

}  // namespace

double SkinGeometry::WallRadius(double z_mm, double angle_rad) const {
  const double at = std::clamp(z_mm / length_mm, 0.0, 1.0) * (rows - 1);
  const int row = std::min(static_cast<int>(at), rows - 2);
  const double up = at - row;
  const auto in_row = [&](int r) {
    const double* radius = wall_mm.data() + static_cast<size_t>(r) * static_cast<size_t>(columns);
    if (columns == 1) return radius[0];
    const double turns = (angle_rad - first_angle_rad) / (2 * kPi);
    const double column = (turns - std::floor(turns)) * columns;
    const int left = static_cast<int>(column) % columns;
    const double share = column - std::floor(column);
    return (1 - share) * radius[left] + share * radius[(left + 1) % columns];
  };
  return (1 - up) * in_row(row) + up * in_row(row + 1);
}

SkinGeometry RestGeometry(const LinkModel& model) {
  SkinGeometry geometry = EmptyGeometry(model, 1);
  geometry.wall_mm = OverZ(RestWall(model), model.length_mm);
  for (int m = 0; m < model.markers.count(); ++m) {
    const double angle = model.PathAngle(model.PathOf(m));
    const double z = model.markers.rings_z_mm[static_cast<size_t>(model.RingOf(m))];
    geometry.feet.push_back(model.PointAtDepth(angle, z, model.thickness_mm));
    geometry.inward.push_back(-model.OutwardNormal(angle, z));
  }
  return geometry;
}

// Interpolates the displacements of the mesh's rows, not their positions: rows are far apart on a curved
// wall.
SkinGeometry DeformedGeometry(const LinkModel& model, const ShellMesh& mesh, const ShellState& state) {
  SkinGeometry geometry = EmptyGeometry(model, mesh.columns);
  const double half_mm = model.thickness_mm / 2;
  for (int m = 0; m < model.markers.count(); ++m) {
    const auto node = static_cast<size_t>(mesh.NodeOfMarker(model, m));
    geometry.feet.push_back(state.mids_mm[node] - half_mm * state.directors[node]);
    geometry.inward.push_back(-state.directors[node]);
  }
  const std::vector<Vec2> rest = RestWall(model);
  geometry.wall_mm.resize(static_cast<size_t>(kWallRows) * static_cast<size_t>(mesh.columns));
  for (int column = 0; column < mesh.columns; ++column) {
    std::vector<double> row_z_mm;
    std::vector<Vec2> moved_mm;
    for (int row = 0; row < mesh.rows; ++row) {
      const auto node = static_cast<size_t>(mesh.Node(column, row));
      const Vec3 before = mesh.mid_mm[node] - half_mm * mesh.normals[node];
      const Vec3 now = state.mids_mm[node] - half_mm * state.directors[node];
      row_z_mm.push_back(before.z());
      moved_mm.emplace_back(Radial(now) - Radial(before), now.z() - before.z());
    }
    std::vector<Vec2> curve = rest;
    size_t i = 0;
    for (Vec2& point : curve) {
      while (i + 2 < row_z_mm.size() && row_z_mm[i + 1] < point.y()) ++i;
      const double share = std::clamp((point.y() - row_z_mm[i]) / (row_z_mm[i + 1] - row_z_mm[i]), 0.0, 1.0);
      point += (1 - share) * moved_mm[i] + share * moved_mm[i + 1];
    }
    const std::vector<double> radius = OverZ(curve, model.length_mm);
    for (size_t row = 0; row < radius.size(); ++row)
      geometry.wall_mm[row * static_cast<size_t>(mesh.columns) + static_cast<size_t>(column)] = radius[row];
  }
  return geometry;
}

}  // namespace taclink
