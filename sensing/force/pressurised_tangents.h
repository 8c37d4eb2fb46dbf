#pragma once

#include <memory>

#include "sensing/force/skin_tangent.h"

namespace taclink {

/// A link's tangents about its inflated shapes, by the nonlinear shell. They are computed at some pressures,
/// closer together where the skin stiffens fastest, when first asked for between two of them, and kept; in
/// between, the markers' motion by the pressure follows a cubic and the compliances a straight line. One
/// thread.
class PressurisedTangents {
 public:
  PressurisedTangents(const LinkModel& model, int refinement, const LoadSites& sites);
  ~PressurisedTangents();

  /// Valid until the next call. Null: the skin has no equilibrium at this pressure that it reaches without a
  /// snap.
  const SkinTangent* At(double pressure_mpa);

  /// The skin's state, to first order, at the pressure of the last tangent that was returned.
  ShellState Inflated() const;

  /// Grows with the pressure by 1 where the skin becomes stiffer by a factor of 1.5 to 2.7.
  double Coordinate(double pressure_mpa) const;

 private:
  struct Shell;
  std::unique_ptr<Shell> shell_;
};

}  // namespace taclink
