#include "sensing/simulation/patch.h"

#include <algorithm>
#include <cmath>

namespace taclink {

PatchFinder::PatchFinder(const LinkModel& model, const ShellMesh& mesh)
    : model_(model), mesh_(mesh), by_node_(static_cast<size_t>(mesh.node_count()), 0.0) {
  const double above_profile = model.profile_depth_mm - model.thickness_mm / 2;
  for (int row = 0; row < mesh.rows; ++row) {
    const auto node = static_cast<size_t>(mesh.Node(0, row));
    row_z_mm_.push_back(mesh.mid_mm[node].z() - above_profile * mesh.normals[node].z());
  }
  const double cell_mm2 = *std::max_element(mesh.areas_mm2.begin(), mesh.areas_mm2.end());
  sample_pitch_mm_ = 0.5 * std::sqrt(cell_mm2);
  touched_.reserve(by_node_.size());
}

void PatchFinder::AddPoint(double angle_rad, double z_mm, double weight) {
  const double turns = (angle_rad - model_.markers.first_path_angle_rad) / (2 * kPi);
  const double column = (turns - std::floor(turns)) * mesh_.columns;
  const int left = static_cast<int>(column);
  const double right_share = column - left;
  const auto above = std::upper_bound(row_z_mm_.begin() + 1, row_z_mm_.end() - 1, z_mm);
  const int row = static_cast<int>(above - row_z_mm_.begin()) - 1;
  const double low = *(above - 1), high = *above;
  const double high_share = std::clamp((z_mm - low) / (high - low), 0.0, 1.0);
  const auto add = [&](int c, int r, double share) {
    if (share <= 0) return;
    const int node = mesh_.Node(c, r);
    double& sum = by_node_[static_cast<size_t>(node)];
    if (sum == 0) touched_.push_back(node);
    sum += weight * share;
  };
  add(left, row, (1 - right_share) * (1 - high_share));
  add(left + 1, row, right_share * (1 - high_share));
  add(left, row + 1, (1 - right_share) * high_share);
  add(left + 1, row + 1, right_share * high_share);
}

void PatchFinder::Collect(std::vector<NodeWeight>& weights) {
  weights.clear();
  for (const int node : touched_) {
    double& sum = by_node_[static_cast<size_t>(node)];
    weights.push_back({node, sum});
    sum = 0;
  }
  touched_.clear();
}

void PatchFinder::AtPoint(double angle_rad, double z_mm, std::vector<NodeWeight>& weights) {
  AddPoint(angle_rad, z_mm, 1);
  Collect(weights);
}

void PatchFinder::AtPatch(double angle_rad, double z_mm, double diameter_mm,
                          std::vector<NodeWeight>& weights) {
  const double radius = diameter_mm / 2;
  // A point in the middle and 6 m points on the m-th circle: each stands for the same area.
  const int circles = std::clamp(static_cast<int>(std::ceil(radius / sample_pitch_mm_)), 2, 24);
  const int points = 1 + 3 * circles * (circles + 1);
  const double skin_radius = model_.PointAtDepth(0, z_mm, 0).x();
  const double share = 1.0 / points;
  AddPoint(angle_rad, z_mm, share);
  for (int m = 1; m <= circles; ++m) {
    const double at = radius * std::sqrt((1.0 + 3 * m * m) / points);
    for (int i = 0; i < 6 * m; ++i) {
      const double turn = 2 * kPi * (i + 0.5) / (6 * m);
      AddPoint(angle_rad + at * std::cos(turn) / skin_radius, z_mm + at * std::sin(turn), share);
    }
  }
  Collect(weights);
}

}  // namespace taclink
