#pragma once

#include <span>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"
#include "sensing/shell/shell_mesh.h"

namespace taclink {

struct NodeWeight {
  int node = 0;
  double weight = 0;
};

/// Finds places on a ShellMesh by the angle and z of the model's profile: bilinear shape functions.
class PatchFinder {
 public:
  PatchFinder(const LinkModel& model, const ShellMesh& mesh);

  /// The nodes around a place; weights add up to 1.
  void AtPoint(double angle_rad, double z_mm, std::vector<NodeWeight>& weights);

  /// The nodal loads that stand for an even load over a round patch of the outer surface, as the elements'
  /// shape functions share it out. Weights add up to 1; they change smoothly as the patch moves.
  void AtPatch(double angle_rad, double z_mm, double diameter_mm, std::vector<NodeWeight>& weights);

 private:
  void AddPoint(double angle_rad, double z_mm, double weight);
  void Collect(std::vector<NodeWeight>& weights);

  // Constant after construction.
  LinkModel model_;
  const ShellMesh& mesh_;
  std::vector<double> row_z_mm_;
  double sample_pitch_mm_ = 0;
  // Scratch.
  std::vector<double> by_node_;
  std::vector<int> touched_;
};

}  // namespace taclink
