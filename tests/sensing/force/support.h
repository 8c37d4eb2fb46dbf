#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/core/skin_shape.h"
#include "sensing/mechanics/linear_shell.h"

namespace taclink {

struct TrueLoad {
  int path, ring;  ///< from 0
  double force_n;  ///< inwards
};

/// What markers would show of `loads` on a shell of `refinement`, with seeded noise: sigma in X and Y, 3
/// sigma in Z.
inline SkinShape ShapeUnder(const LinkModel& model, const std::vector<TrueLoad>& loads, double pressure_mpa,
                            int refinement, double sigma_mm, unsigned seed) {
  static std::map<std::pair<std::string, int>, LinearShell> shells;  // shells take a while to factorise
  const LinearShell& shell = shells.try_emplace({model.name, refinement}, model, refinement).first->second;
  const auto& mesh = shell.mesh();
  std::vector<NodalLoad> nodal;
  for (const auto& [path, ring, force] : loads) {
    const int node = mesh.NodeOfMarker(model, model.MarkerIndex(path, ring));
    nodal.push_back({node, -force * mesh.normals[static_cast<size_t>(node)]});
  }
  const ShellDisplacement u = shell.Solve(nodal);
  const double offset = model.thickness_mm / 2 - model.markers.center_depth_mm;
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 1);
  SkinShape shape;
  for (int m = 0; m < model.markers.count(); ++m) {
    const int node = mesh.NodeOfMarker(model, m);
    const Vec3 true_u =
        u.AtOffset(mesh, node, offset) + pressure_mpa * shell.PerPressure().AtOffset(mesh, node, offset);
    const Vec3 error(sigma_mm * noise(random), sigma_mm * noise(random), 3 * sigma_mm * noise(random));
    shape.displacements_mm.push_back(true_u + error);
    shape.positions_mm.push_back(model.RestMarker(m) + shape.displacements_mm.back());
    const double s2 = std::max(sigma_mm, 0.01) * std::max(sigma_mm, 0.01);
    shape.covariances_mm2.push_back(Vec3(s2, s2, 9 * s2).asDiagonal());
    shape.measured.push_back({shape.displacements_mm.back(), shape.covariances_mm2.back().inverse()});
    shape.sources.push_back(MarkerSource::kBoth);
  }
  return shape;
}

}  // namespace taclink
