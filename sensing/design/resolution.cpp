#include "sensing/design/resolution.h"

#include <Eigen/LU>
#include <cmath>

#include "sensing/camera/projection.h"

namespace taclink {

std::vector<MarkerResolution> FindResolution(const LinkModel& model, const SkinGeometry& geometry,
                                             const SkinVisibility& visibility, double sigma_px) {
  std::vector<MarkerResolution> resolutions(geometry.feet.size());
  for (const CameraId id : kBothCameras) {
    const Projector camera(model.nominal_rig[id]);
    for (size_t m = 0; m < resolutions.size(); ++m) {
      if (!visibility[id][m].is_seen()) continue;
      const auto seen = camera.ProjectWithJacobian(geometry.feet[m]);
      if (!seen) continue;
      resolutions[m].information += seen->jacobian.transpose() * seen->jacobian / (sigma_px * sigma_px);
    }
  }
  for (size_t m = 0; m < resolutions.size(); ++m) {
    if (visibility.SeenBy(static_cast<int>(m)) < kCameraCount) continue;
    const Vec3& foot = geometry.feet[m];
    const double angle = std::atan2(foot.y(), foot.x());
    Mat3 axes;  // R, phi, Z
    axes << std::cos(angle), -std::sin(angle), 0, std::sin(angle), std::cos(angle), 0, 0, 0, 1;
    const Eigen::FullPivLU<Mat3> factor(resolutions[m].information);
    if (!factor.isInvertible()) {
      resolutions[m].sigmas_mm = Vec3::Constant(INFINITY);
      continue;
    }
    resolutions[m].sigmas_mm = Sigmas(axes.transpose() * factor.inverse() * axes);
  }
  return resolutions;
}

}  // namespace taclink
