#pragma once

#include <cstdint>
#include <vector>

#include "sensing/core/geometry.h"

namespace taclink {

/// How a marker's position was obtained.
enum class MarkerSource : uint8_t {
  kBoth,      ///< triangulated
  kTop,       ///< one camera, the missing direction assumed
  kBottom,    ///< one camera, the missing direction assumed
  kInferred,  ///< seen by none: from its neighbours
};

/// Where the markers' centres are. All by marker index (see LinkModel); link frame, mm.
struct SkinShape {
  std::vector<Vec3> positions_mm;
  std::vector<Vec3> displacements_mm;  ///< from the baseline, the shape at rest without pressure
  std::vector<Mat3> covariances_mm2;   ///< of the displacements
  std::vector<MarkerSource> sources;

  int CountOf(MarkerSource source) const {
    int count = 0;
    for (const MarkerSource s : sources) count += s == source ? 1 : 0;
    return count;
  }
  int seen() const { return static_cast<int>(sources.size()) - CountOf(MarkerSource::kInferred); }
};

}  // namespace taclink
