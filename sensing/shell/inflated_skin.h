#pragma once

#include <optional>

#include "sensing/shell/nonlinear_shell.h"
#include "sensing/shell/ring_stiffness.h"

namespace taclink {

/// The equilibrium under pressure alone, which is axisymmetric like the skin at rest.
struct InflatedSkin {
  double pressure_mpa = 0;
  ShellState state;
  RingStiffness stiffness;  ///< at that state, under that pressure
};

/// Newton's method with a line search, started from the slack skin. The unknowns are those of one column of
/// nodes, three per node: radial and axial translation and the rotation of the director. Returns nullopt if
/// no equilibrium is found or if it is unstable, also against states that are not axisymmetric.
/// @pre RingBlocks::Fit(shell).
std::optional<InflatedSkin> Inflate(const NonlinearShell& shell, double pressure_mpa);

}  // namespace taclink
