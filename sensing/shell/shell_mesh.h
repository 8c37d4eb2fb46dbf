#pragma once

#include <array>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// Quadrilateral mesh of the skin's mid-surface. Every marker has its node; a refinement of k divides each
/// interval of the marker grid, and those to the clamped ends, into k. Node (column, row) is row * columns +
/// column; rows 0 and rows - 1 are clamped. Element (column, row), right above and to the side of that node,
/// likewise.
struct ShellMesh {
  int columns = 0;           ///< around the axis, closed
  int rows = 0;              ///< along the axis
  int refinement = 1;        ///< of the intervals between paths
  int refinement_along = 1;  ///< of those between rings
  double thickness_mm = 0;
  std::vector<Vec3> mid_mm;                  ///< nodes on the mid-surface, link frame
  std::vector<Vec3> normals;                 ///< unit, outward: the shell's directors
  std::vector<double> areas_mm2;             ///< of the mid-surface that belongs to each node
  std::vector<std::array<int, 4>> elements;  ///< corner nodes, counter-clockwise seen from outside

  int node_count() const { return columns * rows; }
  int Node(int column, int row) const { return row * columns + (column % columns + columns) % columns; }
  int Column(int node) const { return node % columns; }
  int Row(int node) const { return node / columns; }
  bool IsClamped(int node) const { return Row(node) == 0 || Row(node) == rows - 1; }
  /// The node that carries a marker (see LinkModel for the marker's index).
  int NodeOfMarker(const LinkModel& model, int marker) const {
    return Node(model.PathOf(marker) * refinement, (model.RingOf(marker) + 1) * refinement_along);
  }
};

/// Refines more than asked where an element would span more than 15 degrees around the axis.
ShellMesh MakeShellMesh(const LinkModel& model, int refinement);

/// The same number of elements in every interval between paths, and another between rings.
struct MeshRefinement {
  int around = 1, along = 1;
};
ShellMesh MakeShellMesh(const LinkModel& model, const MeshRefinement& refinement);

}  // namespace taclink
