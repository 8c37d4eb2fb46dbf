#pragma once

#include <array>
#include <vector>

#include "sensing/core/geometry.h"
#include "sensing/core/link_model.h"
#include "sensing/mechanics/shell_mesh.h"

namespace taclink {

/// Where loads may act: nodes of a mesh, at the markers and half way between them (where the mesh has nodes
/// there). Site (column, row) is row * columns + column.
struct LoadSites {
  /// A load at a site, told by markers: bilinear, so that force and first moment on the grid are kept.
  struct Share {
    int marker = 0;
    double share = 0;
  };

  int columns = 0;           ///< around the axis
  int rows = 0;              ///< along it
  int columns_per_path = 1;  ///< sites in one interval between paths
  std::vector<int> nodes;    ///< of the mesh
  /// How a load spreads over nodes. As a patch it takes in the neighbours on a mesh finer than the markers:
  /// no contact is a point, and a point load folds a fine mesh at large displacements.
  struct Spread {
    int node = 0;
    double share = 0;
  };
  std::vector<std::vector<Spread>> spreads;
  std::vector<Mat3> frames;  ///< columns: inward, around, along; unit, at rest
  std::vector<std::array<Share, 4>> shares;
  std::vector<int> nearest_markers;
  std::vector<std::vector<int>> around_markers;  ///< the nearest one and its neighbours
  std::vector<char> beyond_markers;              ///< between a clamped end and the ring next to it

  int count() const { return columns * rows; }
  int Column(int site) const { return site % columns; }
  int Row(int site) const { return site / columns; }
  /// Neighbours on the grid, diagonals too.
  bool AreNeighbours(int a, int b) const;
};

enum class LoadSpread { kPoint, kPatch };
LoadSites MakeLoadSites(const LinkModel& model, const ShellMesh& mesh,
                        LoadSpread spread = LoadSpread::kPoint);

}  // namespace taclink
