#include "sensing/force/load_sites.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace taclink {

bool LoadSites::AreNeighbours(int a, int b) const {
  const int around = std::abs(Column(a) - Column(b));
  return std::min(around, columns - around) <= 1 && std::abs(Row(a) - Row(b)) <= 1;
}

namespace {

std::vector<LoadSites::Spread> SpreadAt(const ShellMesh& mesh, int column, int row, LoadSpread kind) {
  constexpr double kCenter = 0.5;
  const bool at_end = std::min(row, mesh.rows - 1 - row) <= mesh.refinement;
  if (mesh.refinement == 1 || kind == LoadSpread::kPoint || at_end) return {{mesh.Node(column, row), 1}};
  std::vector<LoadSites::Spread> spread = {{mesh.Node(column, row), kCenter}};
  for (const int node : {mesh.Node(column - 1, row), mesh.Node(column + 1, row), mesh.Node(column, row - 1),
                         mesh.Node(column, row + 1)}) {
    if (!mesh.IsClamped(node)) spread.push_back({node, 0});
  }
  for (size_t i = 1; i < spread.size(); ++i) {
    spread[i].share = (1 - kCenter) / static_cast<double>(spread.size() - 1);
  }
  return spread;
}

}  // namespace

LoadSites MakeLoadSites(const LinkModel& model, const ShellMesh& mesh, LoadSpread spread) {
  const int refinement = mesh.refinement;
  const int step = refinement % 2 == 0 ? refinement / 2 : 1;
  const int paths = model.markers.paths, rings = model.markers.rings();
  LoadSites sites;
  sites.columns = mesh.columns / step;
  sites.columns_per_path = refinement / step;
  sites.rows = (mesh.rows - 1) / step - 1;
  for (int row = 1; row <= sites.rows; ++row) {
    for (int column = 0; column < sites.columns; ++column) {
      const int node = mesh.Node(column * step, row * step);
      const Vec3& normal = mesh.normals[static_cast<size_t>(node)];
      const Vec3 around = Vec3::UnitZ().cross(normal).normalized();
      Mat3 frame;
      frame << -normal, around, normal.cross(around);
      sites.nodes.push_back(node);
      sites.spreads.push_back(SpreadAt(mesh, column * step, row * step, spread));
      sites.frames.push_back(frame);
      const double path = static_cast<double>(column) / sites.columns_per_path;
      const double free_ring = static_cast<double>(row) / sites.columns_per_path - 1;
      const double ring = std::clamp(free_ring, 0.0, rings - 1.0);
      sites.beyond_markers.push_back(ring != free_ring);
      const int path_0 = static_cast<int>(path), ring_0 = std::min(static_cast<int>(ring), rings - 2);
      const double a = path - path_0, b = ring - ring_0;
      const int path_1 = (path_0 + 1) % paths;
      sites.shares.push_back({{{model.MarkerIndex(path_0, ring_0), (1 - a) * (1 - b)},
                               {model.MarkerIndex(path_1, ring_0), a * (1 - b)},
                               {model.MarkerIndex(path_0, ring_0 + 1), (1 - a) * b},
                               {model.MarkerIndex(path_1, ring_0 + 1), a * b}}});
      const int near_path = static_cast<int>(std::lround(path)) % paths;
      const int near_ring = static_cast<int>(std::lround(ring));
      sites.nearest_markers.push_back(model.MarkerIndex(near_path, near_ring));
      std::vector<int>& block = sites.around_markers.emplace_back();
      for (int r = std::max(0, near_ring - 1); r <= std::min(rings - 1, near_ring + 1); ++r) {
        for (int p = -1; p <= 1; ++p) block.push_back(model.MarkerIndex((near_path + p + paths) % paths, r));
      }
    }
  }
  return sites;
}

}  // namespace taclink
