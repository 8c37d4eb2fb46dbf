#pragma once

#include <ostream>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/simulation/skin_truth.h"

namespace taclink {

/// Writes one line of JSON: {"frame", "time_s", "pressure_kpa", "contacts": [{"center_mm", "normal",
/// "force_n", "depth_mm", "patch_diameter_mm", "limited"}], "total_force_n", "markers_mm",
/// "displacements_mm"}. Vectors are [x, y, z] in the link frame; the last two by marker index.
/// `rest_markers_mm` is LinkModel::RestMarkers.
void WriteTruthLine(const SkinTruth& truth, const std::vector<Vec3>& rest_markers_mm, std::ostream& out);

}  // namespace taclink
