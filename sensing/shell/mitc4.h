#pragma once

#include <array>

#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// Corner of a shell element: mid-surface point, unit director, and the two unit tangents that its rotation
/// is measured about (director = tangent_1 x tangent_2).
struct ShellCorner {
  Vec3 mid_mm;
  Vec3 director;
  std::array<Vec3, 2> tangents;
};

/// Tangents for a director: any fixed choice will do, this one never degenerates.
std::array<Vec3, 2> TangentsOf(const Vec3& director);

inline constexpr int kDofsPerNode =
    5;  ///< three translations in the link frame, two rotations about the tangents
inline constexpr int kElementDofs = 4 * kDofsPerNode;
using ElementMatrix = Eigen::Matrix<double, kElementDofs, kElementDofs>;
using ElementVector = Eigen::Matrix<double, kElementDofs, 1>;

/// Linear stiffness (N/mm, N, N mm) of the 4-node Mindlin shell with assumed transverse shear strains
/// [dvorkin1984], degenerated from the solid [ahmad1970]. Corners counter-clockwise seen from outside. Plane
/// stress, shear correction 5/6. See mitc4.md.
ElementMatrix Mitc4Stiffness(const std::array<ShellCorner, 4>& corners, double thickness_mm,
                             const Material& material);

/// Nodal loads of a gauge pressure of 1 MPa inside, pushing outwards on the mid-surface (see
/// FollowerPressure); N per MPa.
ElementVector PressureLoad(const std::array<ShellCorner, 4>& corners);

}  // namespace taclink
