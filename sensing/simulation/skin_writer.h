#pragma once

#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/shell/marker_map.h"
#include "sensing/shell/shell_mesh.h"
#include "sensing/simulation/scene.h"
#include "sensing/simulation/skin_truth.h"

namespace taclink {

/// Where the nodes of a simulated skin are: mid-surface, link frame, and directors, which need not be unit.
struct SkinNodes {
  std::vector<Vec3> mids_mm;
  std::vector<Vec3> directors;
};

/// Sets the truth's time, frame and pressure. Returns the time within the scene.
double StartTruth(const Scene& scene, double time_s, SkinTruth& truth);

/// Sets the truth's wall and markers from the deformed nodes. Reuses the truth's buffers.
class SkinWriter {
 public:
  SkinWriter(const LinkModel& model, const ShellMesh& mesh);
  void Write(const SkinNodes& nodes, SkinTruth& truth) const;

  /// Of the undeformed inner wall, by node.
  const std::vector<double>& rest_wall_radius_mm() const { return rest_wall_radius_mm_; }

 private:
  void WriteWall(const SkinNodes& nodes, RadiusGrid& wall) const;
  void WriteMarkers(const SkinNodes& nodes, SkinTruth& truth) const;

  LinkModel model_;
  const ShellMesh& mesh_;
  const MarkerMap map_;
  std::vector<double> rest_wall_radius_mm_;
};

}  // namespace taclink
