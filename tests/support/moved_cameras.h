#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "sensing/camera/projection.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// Where markers seem to be by pixels of `moved` cameras that are taken for those of the model's nominal
/// ones: the least squares of what they would have to project to. Displacements from the model's rest,
/// stacked, mm.
inline Eigen::VectorXd SeenByMoved(const LinkModel& model, const StereoRig& moved,
                                   const Eigen::VectorXd& markers_mm) {
  Eigen::VectorXd seen_mm = markers_mm;
  for (int m = 0; m < model.markers.count(); ++m) {
    const Vec3 rest = model.RestMarker(m), at = rest + markers_mm.segment<3>(3 * m);
    for (int step = 0; step < 10; ++step) {
      Mat3 information = Mat3::Zero();
      Vec3 pull = Vec3::Zero();
      for (const CameraId id : kBothCameras) {
        const Vec2 pixel = Projector(moved[id]).Project(at).value();
        const Vec3 guess = rest + seen_mm.segment<3>(3 * m);
        const auto expected = Projector(model.nominal_rig[id]).ProjectWithJacobian(guess).value();
        information += expected.jacobian.transpose() * expected.jacobian;
        pull += expected.jacobian.transpose() * (pixel - expected.pixel);
      }
      seen_mm.segment<3>(3 * m) += information.ldlt().solve(pull);
    }
  }
  return seen_mm;
}

}  // namespace taclink
