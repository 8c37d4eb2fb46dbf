#pragma once

#include <optional>
#include <span>
#include <vector>

#include "sensing/shell/nonlinear_element.h"
#include "sensing/shell/ring_forces.h"

namespace taclink {

struct ShellState;
struct ShellSurface;

/// The elements of a shell whose surface at rest is a surface of revolution, meshed in rows of nodes and
/// rings of elements. In cylindrical coordinates all elements of a ring are equal: one per ring is kept, and
/// the forces of a ring are computed in vector lanes around the axis (ring_forces.h). Immutable.
class RingShell {
 public:
  /// `elements`: those of the surface. Returns nullopt if it is not meshed like that (ShellSurface::columns),
  /// or if the elements of a ring, such as one with a seam, differ by more than 1e-7 of their largest
  /// coefficient.
  static std::optional<RingShell> Make(const ShellSurface& surface,
                                       std::span<const NonlinearElement> elements, const Material& material);

  int columns() const { return columns_; }
  int rows() const { return static_cast<int>(elements_.rings.size()) + 1; }

  /// Stored energy and that of FollowerPressure, N mm.
  double Energy(const ShellState& state, double pressure_mpa) const;
  /// The same; sets the forces by point and director of each node, N and N mm.
  double Forces(const ShellState& state, double pressure_mpa, RingField& forces) const;

 private:
  RingShell(int columns, RingElements elements) : columns_(columns), elements_(std::move(elements)) {}
  void Load(const ShellState& state, RingField& field) const;

  int columns_;
  RingElements elements_;
};

}  // namespace taclink
