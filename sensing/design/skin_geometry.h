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
  std::vector<Vec3> feet;     ///< of the domes, on the inner wall, by marker index
  std::vector<Vec3> inward;   ///< unit, of the wall under each dome, towards the axis
  /// Radius of the inner wall on an even grid: row i at length_mm * i / (rows - 1), column c at the angle
  /// first_angle_rad + c 2 pi / columns; row * columns + column.
  int rows = 0, columns = 0;
  double first_angle_rad = 0;
  std::vector<double> wall_mm;

  int markers() const { return static_cast<int>(feet.size()); }
  /// Interpolated linearly; `z_mm` between the ends.
  double WallRadius(double z_mm, double angle_rad) const;
  /// At a height over its foot.
  Vec3 OnDome(int marker, double height_mm) const {
    const auto m = static_cast<size_t>(marker);
    return feet[m] + height_mm * inward[m];
  }
};

/// As the model has it: undeformed.
SkinGeometry RestGeometry(const LinkModel& model);

/// Of a state of the model's shell. The wall keeps its thickness, which is off by less than 0.1 of the
/// thickness at working pressures.
SkinGeometry DeformedGeometry(const LinkModel& model, const ShellMesh& mesh, const ShellState& state);

}  // namespace taclink
