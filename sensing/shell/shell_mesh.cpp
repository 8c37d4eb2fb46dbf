#include "sensing/shell/shell_mesh.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace taclink {
namespace {

constexpr double kMaxElementDeg = 15;  // around the axis; coarser ones are far too stiff

// z of all rows of nodes: both clamped ends, every ring, and refinement - 1 rows in between each.
std::vector<double> RowPositions(const LinkModel& model, int refinement) {
  std::vector<double> knots = {0};
  knots.insert(knots.end(), model.markers.rings_z_mm.begin(), model.markers.rings_z_mm.end());
  knots.push_back(model.length_mm);
  std::vector<double> rows;
  for (size_t i = 0; i + 1 < knots.size(); ++i) {
    for (int k = 0; k < refinement; ++k)
      rows.push_back(knots[i] + (knots[i + 1] - knots[i]) * k / refinement);
  }
  rows.push_back(knots.back());
  return rows;
}

void AddNodeAreas(ShellMesh& mesh) {
  mesh.areas_mm2.assign(mesh.mid_mm.size(), 0.0);
  const auto at = [&mesh](int node) -> const Vec3& { return mesh.mid_mm[static_cast<size_t>(node)]; };
  for (const auto& e : mesh.elements) {
    const double area = 0.5 * (at(e[2]) - at(e[0])).cross(at(e[3]) - at(e[1])).norm();
    for (const int node : e) mesh.areas_mm2[static_cast<size_t>(node)] += area / 4;
  }
}

}  // namespace

ShellMesh MakeShellMesh(const LinkModel& model, int refinement) {
  assert(refinement >= 1);
  const double widest = model.markers.path_pitch_rad() / RadFromDeg(kMaxElementDeg);
  refinement = std::max(refinement, static_cast<int>(std::ceil(widest - 1e-9)));
  return MakeShellMesh(model, {refinement, refinement});
}

ShellMesh MakeShellMesh(const LinkModel& model, const MeshRefinement& refinement) {
  assert(refinement.around >= 1 && refinement.along >= 1);
  ShellMesh mesh;
  mesh.refinement = refinement.around;
  mesh.refinement_along = refinement.along;
  mesh.thickness_mm = model.thickness_mm;
  const auto rows_z = RowPositions(model, refinement.along);
  mesh.columns = model.markers.paths * refinement.around;
  mesh.rows = static_cast<int>(rows_z.size());
  for (const double z : rows_z) {
    for (int column = 0; column < mesh.columns; ++column) {
      const double angle = model.markers.first_path_angle_rad + 2 * kPi * column / mesh.columns;
      mesh.mid_mm.push_back(model.PointAtDepth(angle, z, model.thickness_mm / 2));
      mesh.normals.push_back(model.OutwardNormal(angle, z));
    }
  }
  for (int row = 0; row + 1 < mesh.rows; ++row) {
    for (int column = 0; column < mesh.columns; ++column) {
      mesh.elements.push_back({mesh.Node(column, row), mesh.Node(column + 1, row),
                               mesh.Node(column + 1, row + 1), mesh.Node(column, row + 1)});
    }
  }
  AddNodeAreas(mesh);
  return mesh;
}

}  // namespace taclink
