#pragma once

#include <cstdint>
#include <vector>

#include "sensing/core/camera_model.h"
#include "sensing/core/geometry.h"

namespace taclink {

/// How a marker's position was obtained.
enum class MarkerSource : uint8_t {
  kBoth,      ///< both cameras
  kTop,       ///< one camera; the skin's mechanics fill in
  kBottom,    ///< one camera; the skin's mechanics fill in
  kInferred,  ///< seen by none: the skin's mechanics
};

/// What the cameras alone say of a marker's displacement; errors of different markers are independent.
struct MeasuredDisplacement {
  Vec3 displacement_mm = Vec3::Zero();      ///< any value in directions without information
  Mat3 information_per_mm2 = Mat3::Zero();  ///< inverse covariance; rank 2 from one camera, 0 from none
};

/// A labelled marker whose observation contradicts all others; it was left out.
struct RejectedMarker {
  CameraId camera = CameraId::kTop;
  int marker = 0;
};

/// Where the markers' centres are. All by marker index (see LinkModel); link frame, mm.
struct SkinShape {
  std::vector<Vec3> positions_mm;
  std::vector<Vec3> displacements_mm;  ///< from the baseline, the shape in the baseline
  /// Of the displacements, errors of the rest pictures included. Those of the positions, if the markers are
  /// where the model has them. Errors of neighbours are alike: not for use as independent data.
  std::vector<Mat3> covariances_mm2;
  std::vector<MarkerSource> sources;
  std::vector<MeasuredDisplacement> measured;
  std::vector<RejectedMarker> rejected;

  int CountOf(MarkerSource source) const {
    int count = 0;
    for (const MarkerSource s : sources) count += s == source ? 1 : 0;
    return count;
  }
  int seen() const { return static_cast<int>(sources.size()) - CountOf(MarkerSource::kInferred); }
};

}  // namespace taclink
