#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sensing/core/camera_model.h"
#include "sensing/core/link_model.h"
#include "sensing/core/link_state.h"
#include "sensing/core/markers.h"

namespace taclink {

/// How all of a camera's image lies off where its calibration has the markers: a point p of the image is
/// found at c + scale R(turn) M (p - c) + shift, with c the image's middle and M the exchange of left and
/// right if it is mirrored.
struct ImageDisplacement {
  Vec2 shift_px = Vec2::Zero();
  double turn_rad = 0;  ///< from x (right) towards y (down)
  double scale = 1;
  bool is_mirrored = false;
  int spots = 0;              ///< that it explains
  double rms_px = 0;          ///< of these, each axis
  double rms_without_px = 0;  ///< of the same, if the image were not displaced
};

/// Finds the displacement that takes `expected_px` (by marker; none: not in the image) to the spots of an
/// image, whatever its turn. Marker grids look alike when turned by their pitch or mirrored: of several
/// displacements that explain the spots, the one with the fewest parts is taken, and of these the one with
/// the smallest shift. The skin may be touched. None: nothing explains most spots.
std::optional<ImageDisplacement> FindDisplacement(const LinkModel& model, int width_px, int height_px,
                                                  std::span<const std::optional<Vec2>> expected_px,
                                                  const Detections& spots);

/// What is wrong with the cameras of a link whose images do not fit its calibration: they are swapped, or an
/// image is turned, shifted, scaled or mirrored. `skin_mm`: where the untouched skin has its markers, link
/// frame, by marker. None: it is not that, or cannot be told: where top and bottom camera are of one kind, as
/// the shipped barrel's, swapped images look alike until the skin is touched.
std::optional<Reason> DiagnoseImages(const LinkModel& model, const StereoRig& rig,
                                     std::span<const Vec3> skin_mm,
                                     const std::array<Detections, kCameraCount>& spots);

}  // namespace taclink
