#pragma once

#include <optional>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/design/visibility.h"

namespace taclink {

/// How well the cameras tell where a marker is.
struct MarkerResolution {
  Mat3 information = Mat3::Zero();  ///< 1/mm^2, link frame; rank 2: one camera sees it, 0: none
  /// Standard deviations of R, of phi times R and of Z, mm [duong2021, (4.16)-(4.19)]. None: fewer than two
  /// cameras see the marker, and its depth is not measured.
  std::optional<Vec3> sigmas_mm;
};

/// By marker, of those that are seen: least squares of both images [hartley1997], whose positions have a
/// standard deviation of `sigma_px` along each axis, with the nominal cameras. A marker in the plane of the
/// two cameras' centers is told by neither: its sigmas are infinite.
std::vector<MarkerResolution> FindResolution(const LinkModel& model, const SkinGeometry& geometry,
                                             const SkinVisibility& visibility, double sigma_px);

}  // namespace taclink
