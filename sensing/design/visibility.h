#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "sensing/core/camera_model.h"
#include "sensing/core/link_model.h"
#include "sensing/design/skin_geometry.h"

namespace taclink {

/// Visibility of a point of the wall, or of a marker, in a camera's image.
enum class Sight : uint8_t {
  kSeen,
  kTurnedAway,    ///< the camera is behind the wall's tangent plane there
  kOutsideLens,   ///< beyond the angle of validity of the lens model, or behind the camera
  kOutsideImage,  ///< part of the outline is beyond the image's edge
  kBehindWall,
  /// Behind the block in the tube: the tube is transparent, and a block at mid-length keeps the light of one
  /// end from the other end's camera [duong2021, section 3.2].
  kBehindTube,
  kBehindMarker,  ///< a nearer dome covers its center
};
const char* Name(Sight sight);

/// A marker in one camera's image.
struct MarkerView {
  Sight sight = Sight::kOutsideLens;
  /// Extent of the outline along the image radius and across it, foreshortened. 0: not projected.
  double along_px = 0, across_px = 0;
  /// Distance from the outline to the image's edge; negative: beyond it; infinite: not projected.
  double margin_px = -std::numeric_limits<double>::infinity();
  /// Gap to the outline of the nearest neighbor in the image; negative: they overlap.
  double gap_px = std::numeric_limits<double>::infinity();
  int neighbor = -1;  ///< marker index of that neighbor
  /// Smallest distance of the line of sight from the wall, mm; negative: the wall is in the way.
  double clearance_mm = 0;
  Vec2 center_px = Vec2::Zero();  ///< center of the visible part

  bool is_seen() const { return sight == Sight::kSeen; }
  double larger_px() const { return along_px > across_px ? along_px : across_px; }
  double smaller_px() const { return along_px > across_px ? across_px : along_px; }
};

/// Lengths at the ends of the skin: `top_mm` from z = 0, `bottom_mm` from the other end.
struct BlindZone {
  double top_mm = 0, bottom_mm = 0;
};

struct SkinVisibility {
  std::array<std::vector<MarkerView>, kCameraCount> cameras;  ///< by marker index
  /// Where the camera does not see the inner wall at all angles [duong2021, (3.4)].
  std::array<BlindZone, kCameraCount> blind;
  BlindZone blind_to_both;  ///< where some angle is seen by neither camera

  const std::vector<MarkerView>& operator[](CameraId id) const { return cameras[Index(id)]; }
  int SeenBy(int marker) const {
    int count = 0;
    for (const auto& views : cameras) count += views[static_cast<size_t>(marker)].is_seen() ? 1 : 0;
    return count;
  }
};

/// Casts rays against the wall, the tube's block and the domes, with the nominal cameras. `model`: that of
/// `geometry`.
SkinVisibility FindVisibility(const LinkModel& model, const SkinGeometry& geometry);

/// The views of one camera, without the blind zones.
std::vector<MarkerView> ViewsOf(const LinkModel& model, const SkinGeometry& geometry,
                                const CameraModel& camera);

}  // namespace taclink
