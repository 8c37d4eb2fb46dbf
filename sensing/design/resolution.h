#pragma once

#include <optional>
#include <vector>

#include "sensing/core/link_model.h"
#include "sensing/design/visibility.h"

namespace taclink {

/// Uncertainty of a marker's position as measured by the cameras.
struct MarkerResolution {
  Mat3 information = Mat3::Zero();  ///< 1/mm^2, link frame; rank 2: one camera sees it, 0: none
  /// Standard deviations of R, phi R and Z, mm [duong2021, (4.16)-(4.19)]. None: fewer than two cameras see
  /// the marker, so that its depth is not measured.
  std::optional<Vec3> sigmas_mm;
};

/// By marker: least squares of both images [hartley1997] with the nominal cameras, for image positions with a
/// standard deviation of `sigma_px` along each axis. Where the images do not determine the position (on the
/// line through both cameras' centers), the sigmas are infinite.
std::vector<MarkerResolution> FindResolution(const LinkModel& model, const SkinGeometry& geometry,
                                             const SkinVisibility& visibility, double sigma_px);

}  // namespace taclink
