#pragma once

#include <Eigen/Core>
#include <array>

#include "sensing/core/link_model.h"
#include "sensing/estimation/assimilation.h"

namespace taclink {

/// What cameras that have moved or changed a little since the baseline make of all markers together, whose
/// lines of sight are taken for those of cameras that are still where they were. Each mode is one standard
/// deviation of one thing that may happen to one camera, by itself of the others: it is turned or moved,
/// about or along one axis. No change of the focal length: of both cameras that is a growth of the radius,
/// which is the pressure's. Linear, about the model's nominal cameras and its markers at rest. Constant after
/// construction.
class CameraModes {
 public:
  explicit CameraModes(const LinkModel& model);

  /// Stacked markers by mode, mm, link frame. A marker that one camera sees, which `observed` tells by a
  /// direction without information, moves across that camera's line of sight, with that camera alone.
  void Write(const MarkerObservations& observed, Eigen::MatrixXd& modes_mm) const;

  /// Likewise, of all markers as that camera by itself sees them: across its lines of sight.
  const Eigen::MatrixXd& SeenBy(CameraId id) const { return alone_mm_[Index(id)]; }

 private:
  Eigen::MatrixXd both_mm_;
  std::array<Eigen::MatrixXd, kCameraCount> alone_mm_;          // as the camera by itself sees them
  std::array<std::vector<Vec3>, kCameraCount> lines_of_sight_;  // by marker, unit
};

}  // namespace taclink
