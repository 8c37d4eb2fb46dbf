#pragma once

#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"
#include "sensing/shell/nonlinear_shell.h"
#include "sensing/shell/shell_mesh.h"

namespace taclink {

/// The inner wall of a skin and the domes on it, in one state. Link frame, mm.
struct SkinGeometry {
  double length_mm = 0;
  double dome_radius_mm = 0;
  double tube_radius_mm = 0;  ///< 0: no tube
  std::vector<Vec3> feet;     ///< centers of the domes' bases on the inner wall, by marker index
  std::vector<Vec3> inward;   ///< unit normals of the wall under the domes, toward the axis
  /// Radius of the inner wall on a regular grid, index row * columns + column: row i at z = length_mm * i /
  /// (rows - 1), column c at the angle first_angle_rad + c 2 pi / columns.
  int rows = 0, columns = 0;
  double first_angle_rad = 0;
  std::vector<double> wall_mm;

  int markers() const { return static_cast<int>(feet.size()); }
  /// Interpolated linearly; `z_mm` is clamped to the skin's length.
  double WallRadius(double z_mm, double angle_rad) const;
  /// Point on a dome's axis at a height over its foot.
  Vec3 OnDome(int marker, double height_mm) const {
    const auto m = static_cast<size_t>(marker);
    return feet[m] + height_mm * inward[m];
  }
};

/// The undeformed skin of the model.
SkinGeometry RestGeometry(const LinkModel& model);

/// A state of the model's shell. The wall is taken to keep its thickness, with an error below 0.1 of the
/// thickness at working pressures.
SkinGeometry DeformedGeometry(const LinkModel& model, const ShellMesh& mesh, const ShellState& state);

}  // namespace taclink
